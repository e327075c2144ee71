"""What holds for what reads a CyberGlove's bytes, whatever they are: no errors of others, no look ahead, no
growth, and back in step within one frame of any damage.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers import cyberglove_protocol
from thenar.drivers.cyberglove_protocol import (
    INFORMATION,
    REPLY_BYTES,
    SET,
    Command,
    Record,
    Reply,
    find_reply,
    query,
    setting,
)
from thenar.drivers.emulated.cyberglove import CyberGloveBox, Doubts

from ..conftest import calls

Feed = Callable[[bytes], list[Any]]


@dataclass(frozen=True)
class Parser:
    """make returns what is fed, and what tells how many bytes it holds back; frames are sound examples."""

    make: Callable[[], tuple[Feed, Callable[[], int]]]
    frames: tuple[bytes, ...]
    holds: int


def glove(sensors: int, status: bool) -> Parser:
    def make() -> tuple[Feed, Callable[[], int]]:
        decoder = cyberglove_protocol.RecordDecoder(sensors, status=status)
        return decoder.feed, lambda: len(decoder._rest)

    byte = 0x83 if status else None
    records = [Record(bytes([value] * sensors), None, byte) for value in (1, 71, 83, 101, 255)]
    records += [Record(b"S" * sensors, fault, byte) for fault in ("too fast", "unplugged")]
    streamed = tuple(map(cyberglove_protocol.encode, records))
    polled = tuple(b"G" + record[1:] for record in streamed)
    return Parser(make, streamed + polled, sensors + 5)


PARSERS = {
    "glove of 18": glove(18, status=False),
    "glove of 22 with status": glove(22, status=True),
}
NAMES = st.sampled_from(sorted(PARSERS))


@st.composite
def streams(draw: st.DrawFn) -> tuple[Parser, bytes]:
    """Return a parser and a stream of sound frames, cut ones, changed ones, and noise."""
    parser = PARSERS[draw(NAMES)]
    sound = st.sampled_from(parser.frames)
    cut = st.builds(lambda whole, at: whole[at % len(whole) :], sound, st.integers(0, 300))
    short = st.builds(lambda whole, at: whole[: at % len(whole)], sound, st.integers(0, 300))
    changed = st.builds(
        lambda whole, at, by: whole[: at % len(whole)] + bytes([by]) + whole[at % len(whole) + 1 :],
        sound,
        st.integers(0, 300),
        st.integers(0, 255),
    )
    noise = st.binary(max_size=60) | st.integers(1, 600).map(bytes) | st.integers(1, 600).map(lambda n: b"S" * n)
    return parser, b"".join(draw(st.lists(st.one_of(sound, sound, cut, short, changed, noise), max_size=12)))


@given(streams())
def test_no_frame_is_told_before_its_end_is_in_and_none_later(case: tuple[Parser, bytes]) -> None:
    """Fed byte by byte, all that comes, comes with a zero; and it is what comes out at once."""
    parser, stream = case
    feed, _ = parser.make()
    told: list[Any] = []
    for byte in stream:
        found = feed(bytes([byte]))
        assert not found or byte == 0
        assert len(found) <= 1
        told += found
    at_once, _ = parser.make()
    assert at_once(stream) == told


@given(streams())
def test_after_any_damage_the_second_sound_frame_is_told(case: tuple[Parser, bytes]) -> None:
    """The first may be eaten by what stands unfinished before it."""
    parser, stream = case
    for sound in parser.frames:
        feed, _ = parser.make()
        feed(stream)
        feed(sound)
        expected, _ = parser.make()
        assert feed(sound) == expected(sound)


@pytest.mark.parametrize("name", sorted(PARSERS))
@pytest.mark.parametrize("byte", [0, 1, ord("S"), 255])
def test_a_megabyte_of_one_byte_costs_no_memory_or_calls(name: str, byte: int) -> None:
    feed, held = PARSERS[name].make()
    made = set[int]()
    for size in (1, 7, 255, 4096, 100_000, 1_000_000):
        made.add(calls(lambda: feed(bytes([byte]) * size)))  # noqa: B023
        assert held() <= PARSERS[name].holds
        assert feed(bytes([byte]) * size) == []
    assert len(made) == 1


COMMANDS = st.sampled_from(
    [query(letter) for letter in REPLY_BYTES]
    + [setting(letter, bytes(size)) for letter, size in SET.items()]
    + [INFORMATION]
)
REPLIES = st.lists(
    st.sampled_from([b"\0", b"?", b"e", b"s", b"g", b"S", b"G", b"M", b"T", b"?G", b"?T\1\0\1", b"\r\n\0", b"\x03"])
    | st.binary(max_size=9),
    max_size=60,
).map(b"".join)


@given(COMMANDS, REPLIES, st.booleans())
def test_an_answer_has_its_length_and_occurs_in_the_stream(command: Command, received: bytes, last: bool) -> None:
    answer = find_reply(command, received, last=last)
    if answer is None or answer.error is not None:
        return
    assert command.values is None or len(answer.values) == command.values
    assert command.echo + answer.values + (b"\r\n\0" if command.values is None else b"\0") in received


@given(COMMANDS, REPLIES, REPLIES)
def test_an_answer_that_is_whole_is_not_changed_by_what_follows(
    command: Command, received: bytes, following: bytes
) -> None:
    answer = find_reply(command, received)
    if answer is not None:
        assert find_reply(command, received + following) == answer


@given(st.sampled_from(sorted(REPLY_BYTES)), st.binary(min_size=6, max_size=6), st.lists(st.binary(max_size=40)))
def test_an_answer_is_found_behind_any_frames_that_are_not_its_own(
    letter: str, values: bytes, rests: list[bytes]
) -> None:
    """Rests of a stream, of whatever bytes: no echo of the question is among them, and no error."""
    command = query(letter)
    clean = b"".join(rest.replace(b"?", b"!").replace(b"e", b"f") + b"\0" for rest in rests)
    sound = command.echo + values[: command.values] + b"\0"
    assert find_reply(command, clean + sound) == Reply(values[: command.values])


@given(st.lists(st.binary(max_size=200) | REPLIES, max_size=20), st.builds(Doubts, st.booleans(), st.booleans()))
def test_an_emulated_glove_takes_any_bytes_and_still_stops(chunks: list[bytes], doubts: Doubts) -> None:
    box = CyberGloveBox(doubts=doubts)
    for chunk in chunks:
        box.feed(chunk)
        assert len(box._pending) < 600
    box.feed(b"\x03" * 600)
    assert box.feed(b"?S") == [b"?S\x12\0"]
