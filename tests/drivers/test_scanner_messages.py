import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from thenar.drivers import scanner_protocol
from thenar.drivers.scanner_protocol import (
    DEGRADED,
    MOST_KEYS,
    PROTOCOL,
    Event,
    Faults,
    Frame,
    FromBoard,
    GetState,
    Grasp,
    Heartbeat,
    Hello,
    Lost,
    MessageError,
    Ping,
    SetDebounce,
    SetRate,
    State,
    ToBoard,
    frame,
    from_board,
    to_board,
)

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
)
TO_BOARD: st.SearchStrategy[ToBoard] = st.one_of(
    st.builds(SetRate, U32, U32, U32), st.builds(SetDebounce, U16, U16), st.just(GetState()), st.builds(Ping, U16)
)

# Every message with its bytes, as docs/scanner-board.md draws them.
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
    (Lost(1 << 8 | 1 << 39, 40), 0x07, "00 01 00 00 80"),
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
    text = (Path(__file__).parents[2] / "docs" / "scanner-board.md").read_text()
    shown = [bytes.fromhex(found) for found in re.findall(r"`((?:[0-9a-f]{2} )+00)`", text)]
    decoder = scanner_protocol.FrameDecoder()
    assert [read(received) for encoded in shown for received in decoder.feed(encoded)] == [
        State(1 << 0 | 1 << 9 | 1 << 39, 40),
        Event(0x01020304, 39, 1),
        Heartbeat(0x01020304, 1 << 8, 40),
        Grasp(0x01020304, 5, 291, DEGRADED),
        Lost(1 << 8 | 1 << 39, 40),
        GetState(),
        Ping(0x1234),
    ]
    assert decoder.counts == scanner_protocol.FrameCounts(frames=len(shown))
