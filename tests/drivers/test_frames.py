"""Binary frames by a pattern, and the pattern of a sender that nobody has described."""

import math
from random import Random
from struct import pack

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from thenar.drivers.errors import SettingError
from thenar.drivers.frames import FrameParser, guess_frame

# By the pattern: how it is packed, the bytes in front and at the end, how many numbers there are, and their range.
SENDERS = {
    "F0 B10 F7": ("<12B", b"\xf0", b"\xf7", 10, (10, 200)),
    "AA 55 H5": ("<2B5H", b"\xaa\x55", b"", 5, (100, 4000)),
    "> AA 55 H5 0D 0A": (">2B5H2B", b"\xaa\x55", b"\r\n", 5, (100, 4000)),
    "AA h6": ("<B6h", b"\xaa", b"", 6, (-3000, 3000)),
    "0xB5 f4": ("<B4f", b"\xb5", b"", 4, (-90, 90)),
    "AA 55 i3": ("<2B3i", b"\xaa\x55", b"", 3, (-9e6, 9e6)),
}
Frame = tuple[bytes, tuple[float, ...]]


@st.composite
def streams(draw: st.DrawFn) -> tuple[str, list[Frame]]:
    """Return a pattern, and frames in whose numbers the first fixed byte does not occur."""
    pattern = draw(st.sampled_from(sorted(SENDERS)))
    packing, before, after, count, (low, high) = SENDERS[pattern]
    number = st.floats(low, high, width=32) if "f" in packing else st.integers(round(low), round(high))
    rows = draw(st.lists(st.tuples(*[number] * count), min_size=1, max_size=6))
    frames = [(pack(packing, *before, *row, *after), tuple(map(float, row))) for row in rows]
    assume(all(before[0] not in frame[1:] for frame, _ in frames))
    return pattern, frames


def cut(stream: bytes, data: st.DataObject) -> list[bytes]:
    places = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    return [stream[a:b] for a, b in zip([0, *places], [*places, len(stream)], strict=True)]


@given(streams(), st.data())
def test_truncated_frames_and_garbage_lose_only_what_they_touch(
    case: tuple[str, list[Frame]], data: st.DataObject
) -> None:
    pattern, frames = case
    stream, damages = b"", 0
    for frame, _ in frames:
        noise = data.draw(st.just(b"") | st.binary(max_size=9)).replace(frame[:1], b"")
        short = frame[: data.draw(st.integers(0, len(frame) - 1))]
        damages += bool(noise + short)
        stream += noise + short + frame
    parser = FrameParser(pattern)
    rows = [row.values for chunk in cut(stream, data) for row in parser.feed(chunk)]
    if SENDERS[pattern][2]:  # without a fixed byte at its end, a short frame may take bytes of the next one
        assert rows == [numbers for _, numbers in frames]
        assert (parser.counts.misfits, bool(parser.odd)) == (damages, bool(damages))
    assert len(parser._rest) < len(frames[0][0])
    assert parser.feed(2 * frames[-1][0])[-1].values == frames[-1][1]


@pytest.mark.parametrize("pattern", ["", "F0", "B3", "F0 B3 F", "F0 B9999 B9999"])
def test_what_is_no_pattern_is_said(pattern: str) -> None:
    with pytest.raises(SettingError, match=r"needs a fixed byte and a number|neither a byte nor a type"):
        FrameParser(pattern)


def moving(number: int, place: int, low: float, high: float) -> float:
    return low + (high - low) * (0.5 + 0.45 * math.sin(number / (9 + 2 * place) + place))


@pytest.mark.parametrize("pattern", SENDERS)
@pytest.mark.parametrize("every", [0, 37])
def test_the_pattern_of_a_sender_is_found(pattern: str, every: int) -> None:
    packing, before, after, count, limits = SENDERS[pattern]
    frames = []
    for number in range(200):
        numbers = [moving(number, place, *limits) for place in range(count)]
        frames.append(pack(packing, *before, *(numbers if "f" in packing else map(round, numbers)), *after))
    stream = b"".join(frames)[5:]
    found = guess_frame([stream[at : at + every] for at in range(0, len(stream), every)] if every else frames)
    # Where no chunk shows which byte is the first one, any is right.
    assert found == pattern or (every and sorted(found.split()) == sorted(pattern.split()))
    assert len(FrameParser(found).feed(stream)) >= 198


def test_no_pattern_is_found_in_noise_and_in_what_does_not_move() -> None:
    noise = Random(1).randbytes(4000)
    assert [guess_frame([data]) for data in (noise, b"\0" * 4000, b"\xf0\x01\x02\xf7" * 400, b"")] == [""] * 4
