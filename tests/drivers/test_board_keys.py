from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.board_keys import BoardKeys
from thenar.drivers.scanner_messages import WITHOUT_DIODES, Event, Faults, FromBoard, Heartbeat, State

KEYS = 12
EVERY = (1 << KEYS) - 1
MASKS = st.integers(0, EVERY)
MESSAGES: st.SearchStrategy[FromBoard] = st.one_of(
    st.builds(State, MASKS, st.just(KEYS)),
    st.builds(Heartbeat, st.just(0), MASKS, st.just(KEYS)),
    st.builds(Event, st.just(0), st.integers(0, KEYS - 1), st.integers(0, 1)),
    st.just(Faults(0, 0, 0, 0, 0)),
)


def told(keys: BoardKeys, sequence: int, message: FromBoard) -> None:
    keys.numbered(sequence)
    keys.heard(message)


def test_before_a_bitmap_nothing_is_known_and_events_change_nothing() -> None:
    keys = BoardKeys(1, KEYS, sequence=255)
    told(keys, 0, Event(0, 3, 1))
    assert (keys.known, keys.closed, keys.gaps) == (0, 0, 0)
    told(keys, 1, State(0b100, KEYS))
    told(keys, 2, Event(0, 0, 1))
    told(keys, 3, Event(0, 2, 0))
    assert (keys.known, keys.closed) == (EVERY, 0b001)


def test_after_a_gap_nothing_is_known_until_the_next_bitmap() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 1, Heartbeat(0, 0b11, KEYS))
    told(keys, 3, Event(0, 5, 1))
    assert (keys.known, keys.gaps) == (0, 1)
    told(keys, 4, Event(0, 5, 0))
    assert keys.known == 0
    told(keys, 5, State(0b1, KEYS))
    assert (keys.known, keys.closed, keys.gaps) == (EVERY, 0b1, 1)


def test_a_bitmap_after_a_gap_heals_it_itself() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 77, State(0b1, KEYS))
    assert (keys.known, keys.gaps) == (EVERY, 1)


@given(st.lists(st.tuples(MASKS, MASKS), max_size=30), st.sets(st.integers(0, 80)), st.integers(1, 9))
def test_whatever_frames_are_lost_what_is_known_is_true(
    steps: list[tuple[int, int]], lost: set[int], beat: int
) -> None:
    """A board sends an event for every change and now and then a heartbeat; the host never believes anything else."""
    sent: list[tuple[FromBoard, int]] = []
    before = 0
    for number, (closed, _) in enumerate(steps):
        for key in range(KEYS):
            if (before ^ closed) >> key & 1:
                before ^= 1 << key
                sent.append((Event(0, key, before >> key & 1), before))
        if number % beat == 0:
            sent.append((Heartbeat(0, before, KEYS), before))
    keys = BoardKeys(1, KEYS, sequence=255)
    for number, (message, truth) in enumerate(sent):
        if number not in lost:
            told(keys, number & 0xFF, message)
            assert keys.closed & keys.known == truth & keys.known
            assert keys.known or not isinstance(message, Heartbeat)


@given(st.integers(0, 255), MESSAGES)
def test_what_could_not_be_read_may_have_been_an_event(sequence: int, message: FromBoard) -> None:
    keys = BoardKeys(1, KEYS, sequence=sequence)
    told(keys, (sequence + 1) & 0xFF, State(0b1010, KEYS))
    keys.lost()
    assert keys.known == 0
    told(keys, (sequence + 2) & 0xFF, message)
    assert keys.known == (EVERY if isinstance(message, State | Heartbeat) else 0)


def test_possible_ghosts_of_a_matrix_without_diodes_are_not_known() -> None:
    rectangle = State(0b000_011_011, 9)
    for flags, known in ((0, 0b111_111_111), (WITHOUT_DIODES, 0b111_100_100)):
        keys = BoardKeys(3, 3, flags)
        told(keys, 1, rectangle)
        assert keys.known == known
