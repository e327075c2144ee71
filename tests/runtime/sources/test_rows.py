"""Rows as frames: what a column becomes, on which grid, at what time; and what a broken sender does."""

import random
from collections.abc import Callable, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.lines import SEQUENCES, LineCounts, LineParser, Row, RowReader, checked
from thenar.runtime.calibration import numbers_of
from thenar.runtime.errors import HarnessError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources import rows as module
from thenar.runtime.sources.base import sources_of
from thenar.runtime.sources.rows import RowSource, steps_of

GLOVE = """
[debounce]
enabled = false
[[stream]]
port = "x"
columns = ["ms", "thumb", "", "index", "pad", "flex", "bend"]
time = "ms"
rate_hz = 100
switches = ["thumb", "index"]
thresholds = { index = 512 }
[stream.joints]
flex = [0, 4095]
bend = [1.0, -1.0]
[stream.taxels]
pad = [0, 1023]
"""
NAMES = ("index", "pad>700", "thumb", "pad>300")


class Script(RowReader):
    """Rows that come chunk by chunk, at times of a clock of the test's own."""

    def __init__(self, chunks: Sequence[bytes | Row]) -> None:
        self._chunks, self._parser = list(chunks), LineParser()

    def open(self) -> None:
        self._parser.begin()

    def read(self, timeout_s: float) -> Sequence[Row]:
        chunk = self._chunks.pop(0)
        if isinstance(chunk, Row):
            return [chunk]
        self.received += len(chunk)
        rows = self._parser.feed(chunk)
        self.odd = self._parser.odd
        return rows

    def counts(self) -> LineCounts:
        return self._parser.counts

    def close(self) -> None:
        pass


Frames = list[SwitchFrame | GloveFrame]
Play = Callable[..., tuple[RowSource, Frames]]


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch) -> Play:
    def played(
        chunks: Sequence[tuple[int, bytes | Row]],
        text: str = GLOVE,
        names: Sequence[str] = NAMES,
        only: Sequence[str] | None = None,
        faults: list[str] | None = None,
    ) -> tuple[RowSource, Frames]:
        harness = parse_harness(text, "glove.toml")
        source = RowSource(Script([chunk for _, chunk in chunks]), harness, 0, whole_scan(harness, names))
        if only is not None:
            source.read_only(only)
        source.open()
        frames: Frames = []
        for time_us, _ in chunks:
            monkeypatch.setattr(module, "now_us", lambda time_us=time_us: time_us)
            frame = source.read(0)
            while frame is not None:
                frames.append(frame)
                frame = source.read(0) if source._ready else None
            if faults is not None:
                faults.append(source.fault_message())
        return source, frames

    return played


def counted(source: RowSource) -> dict[str, int]:
    return {count.name: count.value for count in source.counts() if count.value}


def test_a_row_is_switches_levels_taxels_and_joints_of_one_moment(play: Play) -> None:
    source, frames = play([(1_000_000, b"5,1,99,512,701,4095,1\n")])
    glove = GloveFrame(1_000_000, bytes((255, 1)))
    assert frames == [SwitchFrame(1_000_000, 0b1110, 0, glove, (701,)), glove]
    assert source.owned == 0b1111
    assert counted(source) == {"rows": 1}


@given(st.integers(0, 4095), st.integers(1, 255))
def test_grids_are_those_that_are_stated(number: int, code: int) -> None:
    assert steps_of((0, 4095)) == 4095
    assert steps_of((0, 3.3)) == 4095
    assert steps_of((0, 65535)) == 4095
    assert steps_of((0, 1)) == 4095
    grid = module._Grid((0, 4095), 0, steps_of((0, 4095)))
    assert grid.code(number) == number
    for limits in ((0.0, 4095.0), (3.3, 0.0), (-90.0, 90.0)):
        (line,) = numbers_of({"joint": limits})
        assert module._Grid(limits, 1, 255).code(line.value(code)) == code


def test_values_that_are_no_numbers_lose_their_inputs_and_no_others(play: Play) -> None:
    source, frames = play([(1_000_000, b"5,nan,0,600,,x?,0\n5,nan,0,600,,,0\n")])
    glove = GloveFrame(1_000_000, bytes((0, 128)))
    assert frames == [SwitchFrame(1_000_000, 0b0001, 0b1110, glove, (None,)), glove]
    assert counted(source) == {"rows": 1, "missing": 3, "misfits": 1}


def test_columns_by_name_in_any_order_and_by_a_header(play: Play) -> None:
    whole = SwitchFrame(0, 0b0100, 0, GloveFrame(0, b"\x01\x80"), (0,))
    for line in (
        b'{"bend": 0, "flex": 0, "index": 0, "thumb": true, "more": 7, "pad": 0, "ms": 1}\n',
        b"bend:0,flex:0,index:0,thumb:1,pad:0,ms:1\n",
        b"thumb;pad;index;flex;bend;ms\n1;0;0;0;0,0;1\n",
        b"calibrated,ready\n1,1,7,0,0,0,0\n",
    ):
        _, frames = play([(0, line)])
        assert frames[0] == whole


def test_named_columns_are_read_by_name_or_not_at_all(play: Play) -> None:
    source, frames = play([(0, b"ms,thumb,spare,idx,pad,flex,bend\n1,1,7,1023,0,0,0\n")])
    assert frames[0] == SwitchFrame(0, 0b0100, 0b0001, GloveFrame(0, b"\x01\x80"), (0,))
    assert source.fault_message() == "its rows lack index: name columns in glove.toml as it does"
    source, frames = play([(0, b"a,b,c,d,e,f,g\n1,1,7,1023,0,0,0\n")])
    assert frames == []
    assert source.fault_message().startswith(
        "its rows have other columns than glove.toml: a, b, c, d, e and 2 more, not ms,"
    )


def test_the_senders_clock_times_rows_by_the_quickest_of_them(play: Play) -> None:
    late = [0, 40_000, 3_000, 90_000, 0, 7_000]
    chunks = [(10_000 * n + 5_000 + by, b"%d,0,0,0,0,0,0\n" % (10 * n)) for n, by in enumerate(late)]
    _, frames = play(chunks)
    times = [frame.time_us for frame in frames if isinstance(frame, SwitchFrame)]
    assert times == [5_000 + 10_000 * n for n in range(6)]


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 10_000_000)), min_size=1, max_size=30))
def test_no_frame_is_of_the_future_and_none_goes_back(steps: list[tuple[int, int]]) -> None:
    clock, came_us, shown = module.SenderClock(10_000), 0, [0]
    for wait_ms, sent in steps:
        came_us += 1000 * wait_ms
        time_us = clock.host_us(float(sent), came_us)
        if isinstance(time_us, int):
            assert shown[-1] <= time_us <= came_us
            shown.append(time_us)


@pytest.mark.parametrize("slow", [-0.02, -0.005, 0.005, 0.02])
def test_a_clock_that_runs_wrong_makes_no_row_old(play: Play, slow: float) -> None:
    chunks = [(10_000 * n, b"%.3f,0,0,0,0,0,0\n" % (10 * n * (1 - slow))) for n in range(1000)]
    _, frames = play(chunks)
    times = [frame.time_us for frame in frames if isinstance(frame, SwitchFrame)]
    assert all(0 <= 10_000 * n - time_us <= 5_000 for n, time_us in enumerate(times))
    assert len(times) == 1000


def test_rows_need_their_clock_but_not_every_sensor(play: Play) -> None:
    chunks = (b"1,1,0,0,0,0,0\n", b"nan,1,0,0,0,0,0\nms,thumb\n7,1\n", b'{"ms": 11, "thumb": 1}\n')
    last = b'{"ms": 11, "thumb": 1, "pad": 3, "flex": 7, "index": 0}\n'
    source, frames = play([(10_000, chunk) for chunk in (*chunks, last)])
    assert counted(source) == {"rows": 2, "missing": 1, "untimed": 1, "wrong columns": 2}
    glove = GloveFrame(10_000, bytes((1, 0)))
    assert frames[-2:] == [SwitchFrame(10_000, 0b0100, 0, glove, (3,)), glove]


def test_what_comes_twice_late_or_not_at_all_is_counted(play: Play) -> None:
    def row(ms: int) -> bytes:
        return b"%d,0,0,0,0,0,0\n" % ms

    sent = [0, 10, 20, 20, 40, 30, 50, 100, 110, 5, 15]
    source, _ = play([(10_000 * n, row(ms)) for n, ms in enumerate(sent)])
    assert counted(source) == {"rows": 7, "repeated": 1, "late": 3, "gaps": 2, "lost": 5}
    assert source.fault_message() == "rows come after later ones and are left out: do two programs send?"


@pytest.mark.parametrize("began_ms", [3_600_000, 100])
def test_rows_of_another_clock_count_once_the_first_one_is_silent(play: Play, began_ms: int) -> None:
    first = [(10_000 * n, b"%d,1,0,0,0,0,0\n" % (60_000 + 10 * n)) for n in range(100)]
    other = [(10_000 * n + 5_000, b"%d,0,0,0,0,0,0\n" % (began_ms + 10 * n)) for n in range(50, 250)]
    source, frames = play(sorted(first + other))
    switches = [frame for frame in frames if isinstance(frame, SwitchFrame)]
    assert [frame.closed for frame in switches[:100]] == [0b0100] * 100
    assert {frame.closed for frame in switches[100:]} == {0}
    found = counted(source)
    assert (found["rows"], found["jumped"], found["restarts"]) == (len(switches), 300 - len(switches), 1)
    assert switches[100].time_us == 10_000 * 99 + 1_005_000
    source, _ = play(sorted(first + other[:50]))
    assert source.fault_message() == "rows of another clock come and are left out: do two programs send?"
    source, _ = play([*first[:1], *other])
    assert source.fault_message() == "its clock has restarted: was the board reset, or does another program send?"


@pytest.mark.parametrize(("unit", "ticks"), [("ms", 1), ("us", 1000), ("board", 1000)])
def test_a_clock_of_32_bits_that_begins_again_costs_no_row(play: Play, unit: str, ticks: int) -> None:
    stamps = [(ticks * (10 * n - 505)) % 2**32 for n in range(100)]
    chunks = [(10_000 * n, b"%d,0,0,0,0,0,0\n" % stamp) for n, stamp in enumerate(stamps)]
    if unit == "board":
        head = board_line("columns", "a", "b")
        chunks = [(10_000 * n, head + board_line("row", n, stamp, n % 4)) for n, stamp in enumerate(stamps)]
        source, frames = play(chunks, BOARD, ("a",), ())
    else:
        source, frames = play(chunks, GLOVE.replace('time = "ms"', f'time = "ms"\ntime_unit = "{unit}"'))
    assert counted(source) == {"rows": 100}
    assert [frame.time_us for frame in frames if isinstance(frame, SwitchFrame)] == [10_000 * n for n in range(100)]


@pytest.mark.parametrize("clock", [b"1e305", b"-1e305", b"nan", b"inf", b"1e17", b""])
def test_a_row_whose_clock_is_no_time_is_left_out_and_said(play: Play, clock: bytes) -> None:
    good = [(10_000 * n, b"%d,1,0,0,0,0,0\n" % (10 * n)) for n in range(4)]
    odd = [(10_000 * n + 5_000, clock + b",0,0,0,0,0,0\n") for n in range(4)]
    source, frames = play(sorted(good + odd), GLOVE.replace('time = "ms"', 'time = "ms"\ntime_unit = "s"'))
    assert [frame.closed for frame in frames if isinstance(frame, SwitchFrame)] == [0b0100] * 4
    assert counted(source)["untimed"] == 4
    assert source.fault_message() == "rows come whose clock is missing, or no time, and are left out"


def test_more_rows_than_stated_are_said_unless_they_had_been_waiting(play: Play) -> None:
    waiting = [(2_000_000, b"".join(b"%d,0,0,0,0,0,0\n" % (10 * n) for n in range(100)))]
    paced = [(2_000_000 + 10_000 * n, b"%d,0,0,0,0,0,0\n" % (1000 + 10 * n)) for n in range(150)]
    source, _ = play(waiting + paced)
    assert source.fault_message() == ""
    source, _ = play([(5_000 * n, b"%d,0,0,0,0,0,0\n" % (5 * n)) for n in range(500)])
    assert source.fault_message() == (
        "200 rows a second arrive, but glove.toml says 100: set rate_hz = 200, unless two programs send"
    )


BOARD = """
[debounce]
enabled = false
[[stream]]
port = "x"
rate_hz = 100
switches = ["a", "b", "c", "d", "e"]
joints = { i = [0, 254], k = [0, 254] }
taxels = { t = [0, 1023], u = [0, 1023] }
[stream.board]
pins = { a = "2" }
"""


def board_line(*fields: str | int) -> bytes:
    return checked(map(str, fields))


@given(st.integers(0, SEQUENCES - 1), st.lists(st.integers(1, SEQUENCES - 1), max_size=20))
def test_the_numbers_of_rows_say_exactly_how_many_are_lost(first: int, steps: list[int]) -> None:
    watch, number = module.RowWatch(10_000), first
    watch.row(0, 0.0, number)
    for step in steps:
        number = (number + step) % SEQUENCES
        watch.row(7, 7.0, number)
    assert (watch.counts.lost, watch.counts.gaps) == (sum(steps) - len(steps), sum(step > 1 for step in steps))
    watch.begin()
    watch.row(8, 8.0, (number + 9) % SEQUENCES)
    assert watch.counts.lost == sum(steps) - len(steps)


def test_rows_that_come_seldom_lose_nothing_and_damaged_ones_are_counted(play: Play) -> None:
    head = board_line("columns", "a", "i")
    sent = [board_line("row", n, 40_000 * n, n % 2, n) for n in range(9)]
    sent[5] = sent[5].replace(b"5", b"6", 1)
    chunks = [(40_000 * n + 500, head + line if n == 0 else line) for n, line in enumerate(sent)]
    source, frames = play(chunks, BOARD, ("a",), ("i",))
    assert counted(source) == {"rows": 8, "gaps": 1, "lost": 1, "damaged": 1}
    assert [frame.time_us for frame in frames if isinstance(frame, GloveFrame)] == [
        40_000 * n + 500 for n in range(9) if n != 5
    ]
    assert source.faults() == "gaps 1, lost 1, damaged 1"


@pytest.mark.parametrize(("names", "only"), [(("b", "t>700"), ("k",)), (("t>9", "t>700"), ()), (("e",), ())])
def test_a_board_may_print_the_kept_elements_only(play: Play, names: tuple[str, ...], only: tuple[str, ...]) -> None:
    """What it prints is used; what the build does not need is not missed; the harness lists all."""
    kept = dict.fromkeys(name.partition(">")[0] for name in (*names, *only))
    switches = [name for name in "abcde" if name in kept]
    readings = [name for name in "ikt" if name in kept]
    lines = board_line("columns", *switches, *readings) + board_line(
        "row", 0, 5, "1" if switches else "", *[800] * len(readings)
    )
    source, frames = play([(1_000_000, lines)], BOARD, names, only)
    glove = [GloveFrame(1_000_000, bytes((0, 255)))] * len(only)
    codes = (800 if "t" in kept else None, None)
    assert frames == [SwitchFrame(1_000_000, (1 << len(names)) - 1, 0, (*glove, None)[0], codes), *glove]
    clipped = {"out of range": 1} if only else {}
    assert counted(source) == {"rows": 1} | clipped
    assert source.fault_message() == ""


def test_a_board_that_lacks_needed_elements_is_told(play: Play) -> None:
    lines = board_line("columns", "a", "t") + board_line("row", 0, 5, 1, 800)
    names = ("a", "b", "t>700")
    source, frames = play([(1_000_000, lines)], BOARD, names, ())
    assert frames == [SwitchFrame(1_000_000, 0b101, 0b010, None, (800, None))]
    assert source.fault_message() == "its rows lack b: upload this build's sketch"
    assert counted(source) == {"rows": 1, "missing": 1}
    source, frames = play([(1_000_000, lines)], BOARD, ("a", "b", "c", "d"), ())
    assert frames == []
    assert counted(source) == {"wrong columns": 1}
    source, _ = play([(1_000_000, lines)], BOARD, ("a",))  # no build: all joints and taxels
    assert counted(source) == {"wrong columns": 1}


def test_times_of_two_clocks_have_no_gap_between_them(play: Play) -> None:
    text = '[[stream]]\nport = "x"\njoints = { flex = [0, 1] }\n'
    rows = [Row(("flex",), (0.5,), stamp) for stamp in (None, 2.0**31, None, 2.0**31 + 0.04)]
    source, frames = play([(20_000 * n, row) for n, row in enumerate(rows)], text, ())
    assert len(frames) == 4
    assert counted(source) == {"rows": 4}


def test_garbage_loses_nothing_but_itself(play: Play) -> None:
    good = [b"%d,1,0,600,0,0,0\n" % (10 * n) for n in range(6)]
    bad = [b"\xff\x00\n", b"1,2\n", b"{]\n", b"8" * 3_000_000 + b"\n", b'{"q": 1}\n', b"1e400,nan,nan,nan,,,\n"]
    mixed = [piece for pair in zip(good, bad, strict=True) for piece in pair]
    source, frames = play([(10_000 * n, piece) for n, piece in enumerate(mixed)])
    assert sum(isinstance(frame, SwitchFrame) and frame.closed == 0b0101 for frame in frames) == 6
    found = counted(source)
    assert (found["misfits"], found["wrong columns"], found["overlong"]) == (2, 2, 1)


def test_what_is_wrong_with_all_rows_is_said(play: Play) -> None:
    source, _ = play([(0, b"1,2,3\n")])
    assert (
        source.fault_message()
        == "its rows have other columns than glove.toml: column 1, column 2, column 3, not "
        + ("ms, thumb, index, pad, flex and 1 more")
    )
    source, _ = play([(0, b"rst:0x10 (POWERON_RESET)\n")])
    assert source.fault_message() == "the data holds no rows: 'rst:0x10 (POWERON_RESET)'"
    source, _ = play([(100_000 * n, b"%d,0,0,0,0,0,0\n" % (100 * n)) for n in range(12)])
    assert source.fault_message() == "10 rows a second arrive, but glove.toml says 100: set rate_hz = 10"


def test_a_rate_that_wavers_is_said_once(play: Play) -> None:
    """Ten rows a second, a little more and less, and then twenty."""
    draw, times, said = random.Random(3), [0], list[str]()
    for number in range(200):
        times.append(times[-1] + draw.randrange(85_000, 115_000) // (1 if number < 100 else 2))
    play([(us, b"%d,0,0,0,0,0,0\n" % (us // 1000)) for us in times], faults=said)
    rates = [sentence.split(" rows")[0] for sentence in said if sentence]
    assert len(dict.fromkeys(rates)) <= 4
    assert float(rates[-1]) == pytest.approx(20, rel=0.15)


def test_a_sender_that_falls_silent_or_sends_something_else_is_said(play: Play) -> None:
    row, silent = b"5,0,0,0,0,0,0\n", "connected, but no row has come for 2 s or longer: is its program running?"
    source, _ = play([(1_000_000, b"boot\n" + row), (2_900_000, b"")])
    assert source.fault_message() == ""
    source, _ = play([(1_000_000, b"boot\n1,2\n" + row), (3_100_000, b"")])
    assert source.fault_message() == silent
    assert source.counts()[0].value == 0
    source, _ = play([(1_000_000, row), (3_100_000, b"1,2\n")])
    assert source.fault_message().startswith("its rows have other columns than glove.toml: column 1, column 2, not ms")
    source, _ = play([(1_000_000, row), (3_100_000, b"rst:0x10 (POWERON_RESET)\n")])
    assert source.fault_message() == "the data holds no rows: 'rst:0x10 (POWERON_RESET)'"
    source, _ = play([(1_000_000, row), (3_100_000, b"\x80\x00\x80")])
    assert source.fault_message() == "bytes come, but no row: check the line ends and, of a serial port, the baud rate"


@pytest.mark.parametrize("moving", [0, 1])
def test_a_clock_that_stands_still_is_said(play: Play, moving: int) -> None:
    still = [(1_000_000 + 10_000 * n, b"7,%d,0,0,0,0,0\n" % (n % 2 * moving)) for n in range(8)]
    source, _ = play(still[:4])
    assert source.fault_message() == ""
    source, _ = play(still)
    assert source.fault_message().startswith("its clock does not change from row to row")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("index = 512", "inde = 512"), "no switch 'inde'"),
        (('switches = ["thumb", "index"]', 'switches = ["thumb", "ring"]'), "no column 'ring'"),
        (('time = "ms"', 'time = "us"'), "no column 'us'"),
        (('time = "ms"', 'time = "ms"\nframe = "F0 X7"'), "'X7' is neither a byte nor a type of numbers: write fixed"),
        (('time = "ms"', 'time = "ms"\nframe = "F0 B5"'), "7 columns are named, but a frame has 5 numbers: name every"),
        (('time = "ms"', 'time = "pad"'), "'pad' is the sender's clock"),
        (('port = "x"', 'port = "mqtt:h/t"\nframe = "F0 B7"'), "frame: is for a port of bytes, not of messages"),
        (("[0, 4095]", "[7, 7]"), "a range from 7"),
        (('"ms", "thumb", ""', '"ms", "thumb", "pad"'), "column 'pad' is already stream"),
        (('switches = ["thumb", "index"]', 'switches = ["thumb", "index", "pad"]'), "'pad' is already stream"),
    ],
)
def test_what_cannot_be_is_said_with_its_line(change: tuple[str, str], said: str) -> None:
    with pytest.raises(HarnessError, match=said):
        parse_harness(GLOVE.replace(*change), "glove.toml")


def test_joints_come_from_one_device() -> None:
    with pytest.raises(HarnessError, match="joints must come from one device"):
        parse_harness(GLOVE + '[cyberglove]\nport = "y"\n', "glove.toml")


def test_a_harness_survives_its_file() -> None:
    harness = parse_harness(GLOVE, "glove.toml")
    assert parse_harness(harness_to_toml(harness), "glove.toml") == harness


def test_a_stream_counts_as_what_it_has() -> None:
    harness = parse_harness(GLOVE, "glove.toml")
    (source,), (nothing,) = (sources_of(harness, names, whole_scan(harness, names)) for names in (NAMES, ()))
    assert (source.period_us, source.owned != 0, source.reads_joints) == (20_000, True, True)
    assert (nothing.owned, nothing.reads_joints) == (0, True)
