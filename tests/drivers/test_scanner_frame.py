from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from thenar.drivers.scanner_protocol import (
    MAX_PAYLOAD,
    OVERHEAD,
    STATE,
    Frame,
    FrameCounts,
    FrameDecoder,
    encode,
    pack_bits,
    unpack_bits,
)

BYTES = st.integers(0, 255)
FRAMES = st.builds(Frame, BYTES, BYTES, st.binary(max_size=MAX_PAYLOAD))
# What a glove of 160 switches sends: mostly zeros.
STATES = st.builds(
    lambda number, closed: Frame(STATE, number, pack_bits(np.isin(np.arange(160), list(closed))).tobytes()),
    BYTES,
    st.sets(st.integers(0, 159), max_size=30),
)


def chunked(stream: bytes, cuts: list[int]) -> list[bytes]:
    ends = sorted({0, len(stream), *(cut % (len(stream) + 1) for cut in cuts)})
    return [stream[start:end] for start, end in pairwise(ends)]


def states(stream: bytes) -> list[Frame]:
    """Return what a driver of 160 switches takes for theirs."""
    return [frame for frame in FrameDecoder().feed(stream) if len(frame.payload) == 20]


def stuffing(encoded: bytes | bytearray) -> set[int]:
    """Return where the length bytes of COBS stand, and the end."""
    places, place = set(), 0
    while place < len(encoded):
        places.add(place)
        place += max(encoded[place], 1)
    return places


def passed_when_damaged(frame: Frame, places: range) -> list[Frame]:
    """Return every other frame that comes out when one byte of two in a row is damaged in any way."""
    encoded, passed = encode(frame), []
    for place in places:
        for turned in range(1, 256):
            damaged = bytearray(encoded * 2)
            damaged[place] ^= turned
            passed += [found for found in FrameDecoder().feed(bytes(damaged)) if found != frame]
    return passed


def crc_bit_by_bit(data: bytes) -> int:
    register = 0xFFFF
    for byte in data:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1 ^ (0x1021 if register & 0x8000 else 0)) & 0xFFFF
    return register


def test_a_frame_is_written_as_the_protocol_says() -> None:
    """Body 02 07 00 80 and its CRC: one COBS block up to the zero, one after it, the end."""
    assert crc_bit_by_bit(b"123456789") == 0x29B1
    crc = crc_bit_by_bit(bytes([2, 7, 0, 0x80]))
    assert encode(Frame(STATE, 7, bytes([0, 0x80]))) == bytes([3, 2, 7, 4, 0x80, crc >> 8, crc & 0xFF, 0])


@given(FRAMES)
@example(Frame(0, 0, b""))
@example(Frame(0, 0, bytes(MAX_PAYLOAD)))
@example(Frame(255, 255, b"\xff" * MAX_PAYLOAD))
def test_what_is_encoded_is_decoded_and_its_length_is_known(frame: Frame) -> None:
    decoder = FrameDecoder()
    encoded = encode(frame)
    assert len(encoded) == len(frame.payload) + OVERHEAD
    assert encoded.index(0) == len(encoded) - 1
    assert decoder.feed(encoded) == [frame]
    assert decoder.counts == FrameCounts(frames=1)


@given(st.lists(st.one_of(FRAMES.map(encode), st.binary(max_size=300))), st.lists(st.integers(0, 10_000)))
def test_any_chunks_give_the_same_frames_and_the_same_counts(parts: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(parts)
    at_once, in_chunks = FrameDecoder(), FrameDecoder()
    expected = at_once.feed(stream)
    assert [frame for chunk in chunked(stream, cuts) for frame in in_chunks.feed(chunk)] == expected
    assert in_chunks.counts == at_once.counts


@given(st.binary(max_size=2000), FRAMES)
def test_after_garbage_and_a_zero_the_next_frame_is_found(garbage: bytes, frame: Frame) -> None:
    assert FrameDecoder().feed(garbage + b"\0" + encode(frame))[-1] == frame


@given(STATES, st.integers(0, 24))
def test_a_lost_byte_costs_one_frame(frame: Frame, place: int) -> None:
    encoded = encode(frame)
    assert states(encoded[:place] + encoded[place + 1 :] + encode(frame)) == [frame]


@given(STATES)
def test_a_lost_end_costs_both_frames_and_no_more(frame: Frame) -> None:
    encoded = encode(frame)
    assert states(encoded[:-1] + encoded + encoded) == [frame]


@given(STATES, st.integers(0, 25), st.integers(1, 255))
def test_a_damaged_byte_of_data_never_gives_another_frame(frame: Frame, place: int, turned: int) -> None:
    """It stays within the 16 bits in which the CRC misses nothing, unless it becomes a zero: then a length is wrong."""
    encoded = bytearray(encode(frame))
    if place in stuffing(encoded):
        return
    encoded[place] ^= turned
    assert states(bytes(encoded)) == []


def test_no_damaged_byte_of_these_frames_gives_another_one() -> None:
    """All 25 bytes and the end, in all 255 ways, stuffing too: there the CRC misses one in 65536, but none of these."""
    random = np.random.default_rng(5)
    for closed in (0, 3, 12, 40):
        bits = np.isin(np.arange(160), random.choice(160, closed, replace=False))
        frame = Frame(STATE, int(random.integers(256)), pack_bits(bits).tobytes())
        assert passed_when_damaged(frame, range(26)) == []


def test_what_was_wrong_is_counted() -> None:
    decoder = FrameDecoder()
    good = encode(Frame(STATE, 1, b"abc"))
    bad = bytes([good[0], good[1] ^ 1]) + good[2:]
    crc = crc_bit_by_bit(b"a")
    short = bytes([4, ord("a"), crc >> 8, crc & 0xFF, 0])  # whole, but for its number
    decoder.feed(b"\0\0" + good + bad + b"\x05a\0" + b"\x02a\0" + short + b"\xff" * 5000 + b"\0" + good)
    assert decoder.counts == FrameCounts(frames=2, damaged=2, short=2, overlong=1)


def test_a_payload_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 250 bytes, not 251"):
        encode(Frame(STATE, 0, bytes(251)))


@given(st.lists(st.booleans(), min_size=1, max_size=200))
def test_bits_come_back_from_the_bitmap(bits: list[bool]) -> None:
    payload = pack_bits(np.array(bits))
    assert payload.shape == ((len(bits) + 7) // 8,)
    assert unpack_bits(payload, len(bits)).tolist() == bits
    assert [bool(payload[k // 8] >> (k % 8) & 1) for k in range(len(bits))] == bits
