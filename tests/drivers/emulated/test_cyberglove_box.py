from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.cyberglove_protocol import (
    MASK_18,
    MASK_22,
    REPLY_BYTES,
    RecordDecoder,
    find_reply,
    query,
    setting,
)
from thenar.drivers.emulated.cyberglove import CyberGloveBox, Doubts
from thenar.drivers.errors import SettingError

VALUES = bytes(range(60, 78))


def box(sensors: int = 18, doubts: Doubts | None = None, not_ready: int = 0) -> CyberGloveBox:
    made = CyberGloveBox(sensors, "CyberGlove", not_ready, doubts)
    made.set(bytes(range(60, 60 + sensors)))
    return made


@pytest.mark.parametrize(
    ("sent", "answered"),
    [
        (b"?G", b"?G\x03\0"),
        (b"?S", b"?S\x12\0"),
        (b"?N", b"?N\x12\0"),
        (b"?M", b"?M\x3f\xbb\x7b\0"),
        (b"?R", b"?R\x01\0"),
        (b"?U", b"?U\0\0"),
        (b"?T", b"?T\0\0\0\0\0"),
        (b"?i", b"?iCyberGlove\r\n\0"),
        (b"T\x04\x80\0\x01?T", b"T\0?T\x04\x80\0\x01\0"),
        (b"U\x01?U", b"U\0?U\x01\0"),
        (b"F\0", b"F\0"),
        (b"\x03", b""),
        (b"U\x02", b"Uen\0"),
        (b"N\0", b"Nen\0"),
        (b"G", b"Ge?\0"),
        (b"Z", b"Ze?\0"),
        (b"?Z", b"?Ze?\0"),
        (b"?I", b"?Ie?\0"),
        (b"K", b"Ke?\0"),
        (b"\xff", b"\xffe?\0"),
    ],
)
def test_a_command_is_answered_as_the_drivers_of_real_gloves_expect(sent: bytes, answered: bytes) -> None:
    assert b"".join(box().feed(sent)) == answered


def test_a_glove_of_22_sensors_says_so() -> None:
    out = box(22).feed(b"?S?N?M")
    assert out == [b"?S\x16\0", b"?N\x16\0", b"?M" + MASK_22 + b"\0"]
    with pytest.raises(SettingError, match="18 and of 22 sensors, not of 20"):
        box(20)


@given(st.sampled_from(sorted(REPLY_BYTES)))
def test_every_query_has_the_length_that_the_driver_counts_on(letter: str) -> None:
    (answered,) = box().feed(b"?" + letter.encode())
    answer = find_reply(query(letter), answered)
    assert answer is not None
    assert len(answer.values) == REPLY_BYTES[letter]


def test_the_doubtful_can_be_had_either_way() -> None:
    other = box(doubts=Doubts(error_echo=False, stop_echo=True, stray_nul=True))
    assert other.feed(b"?Z\x03?i") == [b"e?\0", b"\x03\0", b"?iCyberGlove\r\n\0\0"]


def test_the_box_is_ready_after_its_given_refusals() -> None:
    one = box(not_ready=2)
    assert one.feed(b"?G?G?G") == [b"?G\x01\0", b"?G\x01\0", b"?G\x03\0"]
    one.plugged = False
    assert one.feed(b"?G") == [b"?G\x01\0"]


def test_while_it_streams_it_hears_nothing_but_a_ctrl_c() -> None:
    one = box()
    assert one.feed(b"S?GU\x01G") == []
    assert one.streaming
    assert one.feed(b"\x03?U") == [b"?U\0\0"]
    assert not one.streaming


def test_status_stands_between_sensors_and_fault() -> None:
    one = box()
    one.feed(b"U\x01")
    assert one.record() == b"S" + VALUES + b"\x81\0"
    assert one.record(too_fast=True) == b"S" + VALUES + b"\x81es\0"
    one.plugged = False
    assert one.record(too_fast=True) == b"S" + VALUES + b"\x80eg\0"


def test_a_mask_takes_sensors_out_of_the_records() -> None:
    one = box()
    assert one.feed(b"M\x03\0\0?N") == [b"M\0", b"?N\x02\0"]
    assert one.record() == b"S" + VALUES[:2] + b"\0"
    assert one.feed(b"M" + MASK_18 + b"N\x05") == [b"M\0", b"N\0"]
    assert one.record() == b"S" + VALUES[:5] + b"\0"
    assert one.feed(b"N\x13") == [b"Nen\0"]


@given(st.binary(min_size=18, max_size=18), st.booleans())
def test_only_possible_sensor_bytes_are_accepted_and_read(values: bytes, status: bool) -> None:
    one = box()
    one.feed(setting("U", bytes([status])).request)
    if 0 in values:
        with pytest.raises(SettingError, match="bytes of 1 to 255"):
            one.set(values)
        return
    one.set(values)
    (record,) = RecordDecoder(status=status).feed(one.record())
    assert record.sensors == values
    assert (record.status is not None) == status


@given(st.binary(max_size=100), st.lists(st.integers(0, 100)))
def test_any_bytes_in_any_pieces_bring_about_the_same(data: bytes, cuts: list[int]) -> None:
    ends = sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})
    at_once, in_pieces = box(), box()
    pieces = [data[start:end] for start, end in pairwise(ends)]
    assert [out for piece in pieces for out in in_pieces.feed(piece)] == at_once.feed(data)
    assert in_pieces.streaming == at_once.streaming
