from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.emulated.scanner import ScannerBoard
from thenar.drivers.scanner_protocol import (
    WITHOUT_DIODES,
    Event,
    Faults,
    FrameDecoder,
    FromBoard,
    Heartbeat,
    Lost,
    State,
    from_board,
)
from thenar.drivers.scanner_state import BoardKeys

KEYS = 12
EVERY = (1 << KEYS) - 1
MASKS = st.integers(0, EVERY)
MESSAGES: st.SearchStrategy[FromBoard] = st.one_of(
    st.builds(State, MASKS, st.just(KEYS)),
    st.builds(Heartbeat, st.just(0), MASKS, st.just(KEYS)),
    st.builds(Event, st.just(0), st.integers(0, KEYS - 1), st.integers(0, 1)),
    st.builds(Lost, MASKS, st.just(KEYS)),
    st.just(Faults(0, 0, 0, 0, 0)),
)


def told(keys: BoardKeys, sequence: int, message: FromBoard) -> None:
    keys.numbered(sequence)
    keys.heard(message)


def test_before_a_bitmap_nothing_is_known_and_events_change_nothing() -> None:
    keys = BoardKeys(1, KEYS, sequence=255)
    told(keys, 0, Event(0, 3, 1))
    assert (keys.known, keys.closed, keys.gaps) == (0, 0, 0)
    told(keys, 1, Heartbeat(0, 0b100, KEYS))
    told(keys, 2, Event(0, 0, 1))
    told(keys, 3, Event(0, 2, 0))
    assert (keys.known, keys.closed) == (EVERY, 0b001)
    told(keys, 4, State(0b1000, KEYS))
    assert (keys.known, keys.closed) == (EVERY, 0b1000)


def test_after_a_gap_nothing_is_known_until_the_next_heartbeat() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 1, Heartbeat(0, 0b11, KEYS))
    told(keys, 3, Event(0, 5, 1))
    assert (keys.known, keys.gaps) == (0, 1)
    told(keys, 4, Event(0, 5, 0))
    assert keys.known == 0
    told(keys, 5, State(0b10, KEYS))
    assert keys.known == 0, "keys may be lost, of which a STATE says nothing"
    told(keys, 6, Heartbeat(0, 0b1, KEYS))
    assert (keys.known, keys.closed, keys.gaps) == (EVERY, 0b1, 1)


def test_a_heartbeat_right_after_a_gap_does_not_heal_it_since_a_lost_may_be_missing() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 77, Heartbeat(0, 0b1, KEYS))
    assert (keys.known, keys.gaps) == (0, 1)
    told(keys, 78, Heartbeat(0, 0b1, KEYS))
    assert (keys.known, keys.gaps) == (EVERY, 1)


def test_keys_that_the_board_cannot_read_are_not_known_until_it_says_so() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 1, Lost(0b110, KEYS))
    assert keys.known == 0
    told(keys, 2, Heartbeat(0, 0b11, KEYS))
    assert (keys.known, keys.closed) == (EVERY & ~0b110, 0b11)
    told(keys, 3, Event(0, 1, 0))
    told(keys, 4, Lost(0, KEYS))
    assert (keys.known, keys.closed) == (EVERY, 0b01)


def test_a_heartbeat_that_follows_no_lost_says_that_all_can_be_read() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 1, Lost(0b110, KEYS))
    told(keys, 2, Heartbeat(0, 0, KEYS))
    told(keys, 3, Heartbeat(0, 0, KEYS))
    assert keys.known == EVERY


def test_of_a_board_that_restarted_nothing_is_known_even_if_its_numbers_go_on() -> None:
    keys = BoardKeys(1, KEYS, sequence=254)
    told(keys, 255, Heartbeat(0, 0b11, KEYS))
    keys.numbered(0)
    keys.restarted()
    assert keys.known == 0


@given(
    st.lists(st.tuples(MASKS, st.just(0) | MASKS), max_size=30),
    st.sets(st.integers(1, 80)),
    st.integers(1, 9),
    st.booleans(),
)
def test_whatever_frames_are_missing_what_is_known_is_true(
    steps: list[tuple[int, int]], missing: set[int], beat: int, damaged: bool
) -> None:
    """A board tells every change, of keys and of what it can read, and now and then all; nothing else is believed."""
    board, decoder = ScannerBoard(1, KEYS, heartbeat_us=beat), FrameDecoder()
    board.boot(0)
    keys, truth = BoardKeys(1, KEYS), BoardKeys(1, KEYS)
    for now, (closed, unread) in enumerate(steps):
        for received in decoder.feed(b"".join(board.scan(closed, now, unread=unread))):
            message = from_board(received, KEYS)
            truth.numbered(received.sequence)
            truth.heard(message)
            if received.sequence not in missing:
                told(keys, received.sequence, message)
                assert keys.known in (0, truth.known)
                assert keys.closed & keys.known == truth.closed & keys.known
            elif damaged:
                keys.damaged()
                assert keys.known == 0
        assert (truth.known, truth.gaps) == (EVERY & ~unread, 0)
        assert (truth.closed ^ closed) & ~unread == 0


@given(st.integers(0, 255), MESSAGES)
def test_what_could_not_be_read_may_have_been_an_event(sequence: int, message: FromBoard) -> None:
    keys = BoardKeys(1, KEYS, sequence=sequence)
    told(keys, (sequence + 1) & 0xFF, Heartbeat(0, 0b1010, KEYS))
    keys.damaged()
    assert keys.known == 0
    told(keys, (sequence + 2) & 0xFF, message)
    assert keys.known == (EVERY if isinstance(message, State | Heartbeat) else 0)


@given(st.integers(0, 255), MESSAGES)
def test_a_frame_that_could_not_be_read_may_have_been_anything(sequence: int, message: FromBoard) -> None:
    keys = BoardKeys(1, KEYS, sequence=sequence)
    told(keys, (sequence + 1) & 0xFF, Heartbeat(0, 0b1010, KEYS))
    keys.numbered((sequence + 2) & 0xFF)
    keys.misread()
    told(keys, (sequence + 3) & 0xFF, message)
    assert keys.known == 0
    told(keys, (sequence + 4) & 0xFF, Heartbeat(0, 0b1, KEYS))
    assert keys.known == EVERY & ~(message.lost if isinstance(message, Lost) else 0)
    assert keys.gaps == 0


def test_possible_ghosts_of_a_matrix_without_diodes_are_not_known() -> None:
    rectangle = Heartbeat(0, 0b000_011_011, 9)
    for flags, known in ((0, 0b111_111_111), (WITHOUT_DIODES, 0b111_100_100)):
        keys = BoardKeys(3, 3, flags)
        told(keys, 1, rectangle)
        assert keys.known == known
