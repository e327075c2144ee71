import re
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from thenar.drivers import scanner_protocol
from thenar.drivers.errors import SettingError
from thenar.drivers.scanner_protocol import (
    DEGRADED,
    MAX_PAYLOAD,
    MOST_ASKED,
    MOST_KEYS,
    OVERHEAD,
    PROTOCOL,
    STATE,
    UNREAD,
    Analog,
    Channels,
    Event,
    Faults,
    Frame,
    FrameCounts,
    FrameDecoder,
    FromBoard,
    GetState,
    Grasp,
    Heartbeat,
    Hello,
    Lost,
    MessageError,
    Ping,
    Segment,
    SetChannels,
    SetDebounce,
    SetRate,
    SetSegments,
    State,
    ToBoard,
    encode,
    frame,
    from_board,
    pack_bits,
    to_board,
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


KEYS = 40
U8, U16, U32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
CLOSED = st.integers(0, (1 << KEYS) - 1)
HELLOS = st.builds(
    Hello,
    st.just(PROTOCOL),
    U8,
    U16,
    U32,
    U8,
    U8,
    U8,
    st.integers(1, 12),
    st.integers(1, 150),
    U32,
    U32,
    U32,
    U16,
    U16,
    U32,
)
FROM_BOARD: st.SearchStrategy[FromBoard] = st.one_of(
    HELLOS,
    st.builds(State, CLOSED, st.just(KEYS)),
    st.builds(Heartbeat, U32, CLOSED, st.just(KEYS)),
    st.builds(Event, U32, st.integers(0, KEYS - 1), st.integers(0, 1)),
    st.builds(Faults, U32, U32, U32, U32, U32),
    st.builds(Grasp, U32, U8, U16, U8),
    st.builds(Lost, CLOSED, st.just(KEYS)),
    st.builds(Channels, U8, U8, st.integers(1, 15), U32, st.integers(0, (1 << 20) - 1), st.integers(20, 255)),
    st.builds(Analog, U32, U8, st.lists(U16, max_size=MOST_ASKED).map(tuple)),
)
TO_BOARD: st.SearchStrategy[ToBoard] = st.one_of(
    st.builds(SetRate, U32, U32, U32),
    st.builds(SetDebounce, U16, U16),
    st.just(GetState()),
    st.builds(Ping, U16),
    st.builds(SetChannels, U8, U32, st.integers(0, (1 << 24) - 1), st.sampled_from([24, 32, 248])),
)

# Every message with its bytes, as docs/reference/devices.md draws them.
DRAWN: list[tuple[FromBoard | ToBoard, int, str]] = [
    (
        Hello(1, 1, 0x1234, 0x0A0B0C0D, 1, 2, 3, 1, 40, 1000, 0, 50_000, 5000, 10_000, 0x01020304),
        0x01,
        "01 01 3412 0d0c0b0a 01 02 03 0100 2800 e8030000 00000000 50c30000 8813 1027 04030201",
    ),
    (State(1 << 0 | 1 << 9 | 1 << 39, 40), 0x02, "01 02 00 00 80"),
    (Event(0x01020304, 0x0027, 1), 0x03, "04030201 2700 01"),
    (Heartbeat(0x01020304, 1 << 8, 40), 0x04, "04030201 00 01 00 00 00"),
    (Faults(0x01020304, 1, 2, 3, 4), 0x05, "04030201 01000000 02000000 03000000 04000000"),
    (Grasp(0x01020304, 5, 0x0123, 0x03), 0x06, "04030201 05 2301 03"),
    (Segment(0x01020304, 0x0123, 5, 2), 0x0A, "04030201 2301 05 02"),
    (SetSegments(1), 0x16, "01"),
    (Lost(1 << 8 | 1 << 39, 40), 0x07, "00 01 00 00 80"),
    (Channels(2, 0x2A, 10, 5000, 1 << 0 | 1 << 9 | 1 << 15, 20), 0x08, "02 2a 0a 88130000 14 01 82 00"),
    (Analog(0x01020304, 0x2A, (0, 0x03FF, 0xFFFF)), 0x09, "04030201 2a 0000 ff03 ffff"),
    (SetChannels(0x2A, 5000, 1 << 0 | 1 << 9 | 1 << 15, 16), 0x15, "2a 88130000 01 82"),
    (SetRate(1000, 2000, 50_000), 0x11, "e8030000 d0070000 50c30000"),
    (SetDebounce(5000, 10_000), 0x12, "8813 1027"),
    (GetState(), 0x13, ""),
    (Ping(0x1234), 0x14, "3412"),
]


def read(received: Frame) -> FromBoard | ToBoard:
    return to_board(received) if received.kind > 0x10 else from_board(received, KEYS)


@pytest.mark.parametrize(("message", "kind", "payload"), DRAWN)
def test_messages_are_written_as_the_documentation_draws_them(
    message: FromBoard | ToBoard, kind: int, payload: str
) -> None:
    assert frame(message, 7) == Frame(kind, 7, bytes.fromhex(payload))
    assert read(Frame(kind, 7, bytes.fromhex(payload))) == message


@given(st.one_of(FROM_BOARD, TO_BOARD), st.integers(0, 100_000))
def test_what_is_written_is_read(message: FromBoard | ToBoard, number: int) -> None:
    (received,) = scanner_protocol.FrameDecoder().feed(scanner_protocol.encode(frame(message, number)))
    assert received.sequence == number % 256
    assert read(received) == message


@given(st.one_of(FROM_BOARD, TO_BOARD), st.integers(1, 5), st.booleans())
def test_another_length_is_refused(message: FromBoard | ToBoard, surplus: int, longer: bool) -> None:
    payload = message.payload()
    if isinstance(message, Analog | SetChannels):  # their length says how many channels there are
        payload, longer = payload[: 5 + isinstance(message, Analog)], False
    if not longer and len(payload) < surplus:
        return
    other = payload + bytes(surplus) if longer else payload[:-surplus]
    with pytest.raises(MessageError):
        read(Frame(message.KIND, 0, other))


@given(U8 | st.integers(1, 5), U8, st.binary(max_size=300), st.integers(0, MOST_KEYS) | st.integers(0, 40))
@example(Heartbeat.KIND, 0, b"", 0)
@example(Heartbeat.KIND, 0, b"123", 0)
def test_any_frame_is_a_message_that_writes_the_same_frame_or_a_message_error(
    kind: int, sequence: int, payload: bytes, keys: int
) -> None:
    received = Frame(kind, sequence, payload)
    for reads in (lambda: from_board(received, keys), lambda: to_board(received)):
        try:
            message = reads()
        except MessageError:
            continue
        assert frame(message, sequence) == received


@pytest.mark.parametrize(("key", "edge"), [(40, 0), (0xFFFF, 1), (0, 2), (39, 255)])
def test_an_event_of_no_key_or_no_edge_is_refused(key: int, edge: int) -> None:
    with pytest.raises(MessageError, match=f"key {key}, edge {edge}"):
        from_board(frame(Event(0, key, edge), 0), 40)


@pytest.mark.parametrize(("keys", "payload"), list(product([3, 7], [b"\x80", b"\xff"])))
def test_a_bitmap_that_holds_a_key_beyond_the_last_is_refused(keys: int, payload: bytes) -> None:
    with pytest.raises(MessageError, match="holds key 7"):
        from_board(Frame(State.KIND, 0, payload), keys)


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        ("02 01 00 00000000 08 00", "codes of 0 bits"),
        ("02 01 10 00000000 08 00", "codes of 16 bits"),
        ("02 01 0a 00000000 07 80", "holds key 7"),
        ("02 01 0a 00000000 7b" + "ff" * 15 + "07", "123 channels in an ANALOG"),
    ],
)
def test_channels_that_cannot_be_are_refused(payload: str, said: str) -> None:
    with pytest.raises(MessageError, match=said):
        from_board(Frame(Channels.KIND, 0, bytes.fromhex(payload)), 0)


def test_the_most_channels_just_fit_an_analog_frame() -> None:
    assert len(encode(frame(Analog(0, 1, (UNREAD,) * MOST_ASKED), 0))) == 255
    with pytest.raises(ValueError, match="at most 250"):
        encode(frame(Analog(0, 1, (0,) * (MOST_ASKED + 1)), 0))


def test_a_value_beyond_its_field_is_refused() -> None:
    with pytest.raises(SettingError, match="no frame can carry 1, 4294967296"):
        SetChannels(1, 1 << 32, 0, 0).payload()


def test_a_board_of_another_protocol_is_told_so_whatever_follows() -> None:
    with pytest.raises(MessageError, match="protocol 2, this is 1: update"):
        from_board(Frame(Hello.KIND, 0, b"\x02 something else"), 0)


@pytest.mark.parametrize(("rows", "columns"), [(0, 40), (40, 0), (1, MOST_KEYS + 1), (0xFFFF, 0xFFFF)])
def test_a_board_of_no_keys_or_more_than_fit_a_frame_is_refused(rows: int, columns: int) -> None:
    hello = Hello(PROTOCOL, 0, 0, 1, 1, 0, 0, rows, columns, 1000, 0, 0, 0, 0, 0)
    with pytest.raises(MessageError, match=r"x \d+ keys"):
        Hello.read(hello.payload())


def test_the_most_keys_just_fit_a_heartbeat() -> None:
    every = (1 << MOST_KEYS) - 1
    heartbeat = Heartbeat(0, every, MOST_KEYS)
    (received,) = scanner_protocol.FrameDecoder().feed(scanner_protocol.encode(frame(heartbeat, 0)))
    assert from_board(received, MOST_KEYS) == heartbeat


@given(st.lists(st.booleans(), min_size=1, max_size=160))
def test_the_bitmap_is_that_of_scanner_frame(bits: list[bool]) -> None:
    closed = sum(1 << key for key, bit in enumerate(bits) if bit)
    assert State(closed, len(bits)).payload() == scanner_protocol.pack_bits(np.array(bits)).tobytes()


@pytest.mark.parametrize(
    ("state_us", "heartbeat_us", "period_us"), [(0, 0, 0), (2000, 0, 2000), (0, 5, 5), (2000, 50, 50), (20, 50, 20)]
)
def test_the_period_of_a_board_is_the_shorter_of_what_it_sends(
    state_us: int, heartbeat_us: int, period_us: int
) -> None:
    assert Hello(1, 0, 0, 1, 1, 0, 0, 1, 40, 1, state_us, heartbeat_us, 0, 0, 0).period_us == period_us


def test_the_frames_in_the_documentation_are_sound_ones() -> None:
    text = (Path(__file__).parents[2] / "docs" / "reference" / "devices.md").read_text()
    shown = [bytes.fromhex(found) for found in re.findall(r"`((?:[0-9a-f]{2} )+00)`", text)]
    decoder = scanner_protocol.FrameDecoder()
    assert [read(received) for encoded in shown for received in decoder.feed(encoded)] == [
        State(1 << 0 | 1 << 9 | 1 << 39, 40),
        Event(0x01020304, 39, 1),
        Heartbeat(0x01020304, 1 << 8, 40),
        Grasp(0x01020304, 5, 291, DEGRADED),
        Segment(0x01020304, 3, 2, 2),
        Lost(1 << 8 | 1 << 39, 40),
        GetState(),
        Ping(0x1234),
        SetChannels(0x2A, 5000, 1 << 0 | 1 << 9 | 1 << 15, 16),
        Channels(2, 0x2A, 10, 5000, 1 << 0 | 1 << 9 | 1 << 15, 20),
        Analog(0x01020304, 0x2A, (0, 1023, UNREAD)),
    ]
    assert decoder.counts == scanner_protocol.FrameCounts(frames=len(shown))
