"""The C debouncer against drivers.debounce.Debouncer."""

import ctypes
from collections.abc import Callable

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from thenar.compiler.firmware.protocol import BoardConfig, protocol_files
from thenar.drivers.debounce import Debouncer

SharedLibrary = Callable[..., ctypes.CDLL]
KEYS, BYTES = 19, 3
WRAP = 1 << 32
# As far back as time can go, and as far forth, between two scans.
BACK_US = 0xFF_FFFF
LONGEST_US = WRAP - BACK_US - 1

MASKS = st.integers(0, (1 << KEYS) - 1)
FEW = st.sampled_from([0, 1, (1 << KEYS) - 1])
TIMES = st.one_of(st.just(0), st.integers(0, 0xFFFF), st.sampled_from([0, 1, 5_000, 10_000, 0xFFFF]))
STEPS = st.one_of(st.sampled_from([500, 1000, 1000, 1000, 5000]), st.integers(0, 15_000), st.integers(0, LONGEST_US))
SCANS = st.lists(st.tuples(STEPS, MASKS | FEW, MASKS | FEW), max_size=60)
STARTS = st.one_of(st.integers(WRAP - 30_000, WRAP - 1), st.integers(0, WRAP - 1))


class Keys:
    """thenar_debounce.c."""

    def __init__(self, shared_library: SharedLibrary) -> None:
        files = protocol_files(BoardConfig(1, KEYS))
        self.library = shared_library(
            {name: text for name, text in files.items() if not name.endswith(("board.c", "frames.c"))}
        )
        self.library.thenar_debounce.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_uint32]

    def begin(self, press_us: int, release_us: int) -> None:
        self.library.thenar_debounce_boot()
        self.set(press_us, release_us)

    def set(self, press_us: int, release_us: int) -> None:
        self.library.thenar_debounce_set(press_us, release_us)

    def update(self, time_us: int, closed: int, known: int) -> int:
        bitmap = ctypes.create_string_buffer(closed.to_bytes(BYTES, "little"), BYTES)
        self.library.thenar_debounce(bitmap, known.to_bytes(BYTES, "little"), time_us % WRAP)
        return int.from_bytes(bitmap.raw, "little")


@pytest.fixture(scope="module")
def keys(shared_library: SharedLibrary) -> Keys:
    return Keys(shared_library)


@given(TIMES, TIMES, STARTS, SCANS)
@example(0, 2, 0, [(0, 1, 1), (1, 1, 1), (2, 0, 1)])
@example(5000, 10_000, WRAP - 500, [(1000, 1, 1), (1000, 0, 1), *[(1000, 0, 1)] * 20, (1000, 1, 1)])
@example(5000, 10_000, WRAP - 6500, [(1000, n < 3, 1) for n in range(30)])
@example(65535, 65535, 0, [(1000, 1, 1), (0, 0, 1), (65534, 0, 1), (1, 0, 1), (1, 0, 1), (65535, 0, 1)])
def test_every_answer_is_pythons_also_where_the_clock_wraps(
    keys: Keys, press_us: int, release_us: int, start: int, scans: list[tuple[int, int, int]]
) -> None:
    keys.begin(press_us, release_us)
    python, now = Debouncer(press_us, release_us), start
    for passed, closed, known in scans:
        now += passed
        assert keys.update(now, closed, known) == python.update(now, closed, known)


@given(
    STARTS,
    st.lists(st.tuples(st.integers(-BACK_US, 20_000) | st.integers(-3000, 3000), MASKS | FEW, MASKS), max_size=40),
)
def test_time_that_goes_back_stands_still(keys: Keys, start: int, scans: list[tuple[int, int, int]]) -> None:
    keys.begin(5000, 10_000)
    python, last = Debouncer(5000, 10_000), start + BACK_US
    for passed, closed, known in scans:
        now = last + passed
        assert keys.update(now, closed, known) == python.update(now, closed, known)
        last = max(last, now)


@given(SCANS, SCANS, TIMES, TIMES)
def test_other_times_end_those_that_run_and_change_no_key(
    keys: Keys, before: list[tuple[int, int, int]], after: list[tuple[int, int, int]], press_us: int, release_us: int
) -> None:
    keys.begin(5000, 10_000)
    python, now = Debouncer(5000, 10_000), 0
    for passed, closed, known in before:
        now += passed
        assert keys.update(now, closed, known) == python.update(now, closed, known)
    keys.set(press_us, release_us)
    again = Debouncer(press_us, release_us)
    again._closed, again._time, again._period = python._closed, python._time, python._period
    for passed, closed, known in after:
        now += passed
        assert keys.update(now, closed, known) == again.update(now, closed, known)


def test_bits_beyond_the_last_key_are_not_keys(keys: Keys) -> None:
    keys.begin(5000, 10_000)
    everything = (1 << 8 * BYTES) - 1
    assert keys.update(0, everything, everything) == (1 << KEYS) - 1
