from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.runtime.errors import FormatError, FrameError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.recording.layout import glove_bytes, glove_frame, switch_bytes, switch_frame

times = st.integers(0, 2**63)


@st.composite
def gloves(draw: st.DrawFn, sensors: int) -> GloveFrame:
    data = draw(st.binary(min_size=sensors, max_size=sensors))
    return GloveFrame(draw(times), data, draw(st.none() | st.integers(0, 255)))


@given(st.data(), st.integers(0, 170), st.integers(0, 22))
def test_switches_come_back_as_they_were(data: st.DataObject, switches: int, sensors: int) -> None:
    masks = st.integers(0, (1 << switches) - 1)
    frame = SwitchFrame(
        data.draw(times),
        closed=data.draw(masks),
        lost=data.draw(masks),
        glove=data.draw(st.none() | gloves(sensors)),
    )
    assert switch_frame(frame.time_us, switch_bytes(frame, switches, sensors), switches, sensors) == frame


@given(st.data(), st.integers(0, 22))
def test_gloves_come_back_as_they_were(data: st.DataObject, sensors: int) -> None:
    frame = data.draw(gloves(sensors))
    assert glove_frame(frame.time_us, glove_bytes(frame, sensors), sensors) == frame


def test_switches_are_0_open_1_closed_and_2_unknown() -> None:
    assert list(switch_bytes(SwitchFrame(0, 0b1010, lost=0b1100), 4, 0)) == [0, 1, 2, 3]


@pytest.mark.parametrize("field", ["closed", "lost"])
@pytest.mark.parametrize("switches", [0, 3, 8])
def test_bits_of_switches_that_are_not_recorded_are_refused(field: str, switches: int) -> None:
    masks: dict[str, Any] = {field: 1 << switches}
    frame = replace(SwitchFrame(0, 0), **masks)
    with pytest.raises(FrameError, match=f"beyond the {switches} recorded switches"):
        switch_bytes(frame, switches, 0)


def test_a_record_of_another_glove_is_refused_with_advice() -> None:
    with pytest.raises(FrameError, match=r"22 sensors, but 18 are recorded: set the number under \[cyberglove\]"):
        glove_bytes(GloveFrame(0, bytes(22)), 18)


@given(st.binary(max_size=40), st.integers(0, 20), st.integers(0, 20))
def test_any_bytes_are_a_frame_or_refused(data: bytes, switches: int, sensors: int) -> None:
    try:
        frame = switch_frame(1, data, switches, sensors)
    except FormatError:
        return
    assert switch_bytes(frame, switches, sensors) == data


def test_a_state_that_no_switch_has_is_refused() -> None:
    with pytest.raises(FormatError, match="a switch in state 8"):
        switch_frame(0, b"\x00\x08", 2, 0)


@pytest.mark.parametrize("length", [17, 20])
def test_a_glove_of_another_length_is_refused(length: int) -> None:
    with pytest.raises(FormatError, match=f"{length} bytes, but its session names 18 sensors"):
        glove_frame(0, bytes(length), 18)
