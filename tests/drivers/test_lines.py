"""Lines of numbers, whatever comes between them."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.lines import (
    CLOCK_US,
    LONGEST,
    SEQUENCES,
    ColumnHeader,
    Damaged,
    LineCounts,
    LineParser,
    Row,
    checked,
    parsed,
    switches_field,
)

numbers = st.floats(-1e9, 1e9).map(lambda number: round(number, 6))
rows = st.lists(numbers, min_size=2, max_size=8)


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", "])
@given(values=rows)
def test_a_row_is_parted_by_what_people_part_rows_by(separator: str, values: list[float]) -> None:
    assert parsed(separator.join(map(repr, values)).encode()) == Row(None, tuple(values))


@given(st.lists(st.one_of(st.binary(max_size=40), rows.map(lambda row: ",".join(map(repr, row)).encode()))), st.data())
def test_where_chunks_end_changes_nothing(lines: list[bytes], data: st.DataObject) -> None:
    ends = (b"\n", b"\r\n", b"\r")
    stream = b"".join(line.replace(b"\n", b"") + ends[place % 3] for place, line in enumerate(lines))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    whole, parts = LineParser(), LineParser()
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert [row for piece in pieces for row in parts.feed(piece)] == whole.feed(stream)
    assert parts.counts == whole.counts


@pytest.mark.parametrize(
    ("line", "values"),
    [
        (b"1,nan,3", (1, None, 3)),
        (b"1,,inf", (1, None, None)),
        (b"1e999,2", (None, 2)),
        (b"1;2,5;3", (1, 2.5, 3)),
        (b"[1, 2.5e0, -3]", (1, 2.5, -3)),
        (b'{"a": true, "b": null, "c": [1], "d": 1e999, "e": NaN}', (1, None, 1, None, None)),
        (b"\xef\xbb\xbf7 8", (7, 8)),
        (b'"1","2"', (1, 2)),
        (b'{"a": "1", "b": " -2.5", "c": "on", "d": {"e": 1}}', (1, -2.5, None, 1)),
        (b"2024-02-30T00:00:00,25:00:00,4", (None, None, 4)),
    ],
)
def test_values_that_are_no_numbers_are_none(line: bytes, values: tuple[float | None, ...]) -> None:
    found = parsed(line)
    assert isinstance(found, Row)
    assert found.values == values


@pytest.mark.parametrize(
    "line",
    [
        b"ets Jun  8 2016 00:22:57",
        b"hello world",
        b"1,2,x3",
        b"12,0,1,10\xff3",
        b'{"a": 1',
        b'{"a": ' + b"[" * 9000,
        b"[]",
        b"{}",
        b"1_000,2",
        b"0x,2",
        b"1F,2A",
        b"<1,2",
        b"DATA:1,x,2",
        b"rst:0x10 (RTCWDT_RTC_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)",
        b"battery 87",
        b"a:1,a:2",
        b":1",
        b"9" * 401 + b"x",
        b"ready",
        b"A512A300",
        b"A512",
        b"HIJ",
        b"A512,B300,C200",
    ],
)
def test_anything_else_is_a_misfit_and_is_shown(line: bytes) -> None:
    parser = LineParser()
    assert parser.feed(line + b"\n1,2\n") == [Row(None, (1, 2))]
    assert parser.counts.misfits == 1
    assert parser.odd.isprintable()
    assert 0 < len(parser.odd) < 100


def test_a_header_names_the_rows_after_it_until_the_line_begins_anew() -> None:
    parser = LineParser()
    assert parser.feed(b"1,2\nms,thumb\n3,4\n5,6,7\n") == [
        Row(None, (1, 2)),
        Row(("ms", "thumb"), (3, 4)),
        Row(None, (5, 6, 7)),
    ]
    assert parsed(b"ms, thumb tip") == ColumnHeader(("ms", "thumb tip"))
    assert parser.counts.misfits == 0
    assert parser.feed(b"saved,3 files\nno,more,words\n8,9\nms,thumb\n8,9\n") == 2 * [Row(("ms", "thumb"), (8, 9))]
    assert (parser.counts.misfits, parser.odd) == (2, "'no,more,words'")
    parser.begin()
    assert parser.feed(b"1,2\n") == [Row(None, (1, 2))]


@pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n", b"\n\r"])
def test_lines_end_with_carriage_returns_and_line_feeds(end: bytes) -> None:
    assert LineParser().feed(b"1,2" + end + b"3,4" + end) == [Row(None, (1, 2)), Row(None, (3, 4))]


def test_a_text_in_a_row_of_known_width_is_a_missing_value() -> None:
    row = b"5,1,fist\n5,fist,open\n5,1,2,fist\n"
    parser = LineParser()
    assert parser.feed(b"ms,flex [deg],label\n" + row) == [Row(("ms", "flex [deg]", "label"), (5, 1, None))]
    assert (parser.counts.misfits, parser.odd) == (2, "'5,1,2,fist'")
    assert LineParser(3).feed(row) == [Row(None, (5, 1, None))]
    assert LineParser().feed(row) == []
    assert LineParser(3).feed(b"booting\n" + row) == [Row(None, (5, 1, None))]
    labels = b"label,flex,pad\nfist,5,1\nopen,4,0\n"
    assert [found.values for found in LineParser().feed(labels)] == [(None, 5, 1), (None, 4, 0)]
    assert parser.feed(b"ready\n" + row) == [Row(("ms", "flex [deg]", "label"), (5, 1, None))]


@given(st.binary(max_size=200), st.integers(0, 9))
def test_nothing_that_comes_raises(line: bytes, columns: int) -> None:
    parsed(line, columns)


def test_ten_megabytes_without_line_feed_fill_no_memory() -> None:
    parser = LineParser()
    for _ in range(160):
        assert parser.feed(b"7" * 65_536) == []
        assert len(parser._rest) <= LONGEST
    assert parser.feed(b"7\n1,2\n") == [Row(None, (1, 2))]
    assert parser.counts == LineCounts(overlong=1)
    assert parser.feed(b"7" * (LONGEST + 1) + b"\n3,4\n") == [Row(None, (3, 4))]
    assert parser.counts == LineCounts(overlong=2)


class Sent(NamedTuple):
    """A board's row as its sketch has it."""

    sequence: int
    clock_us: int
    closed: tuple[bool, ...]
    readings: tuple[int | None, ...]

    def line(self) -> bytes:
        mask = sum(1 << switch for switch, closed in enumerate(self.closed) if closed)
        readings = ("" if reading is None else str(reading) for reading in self.readings)
        head = ("row", str(self.sequence), str(self.clock_us), switches_field(mask, len(self.closed)))
        return checked((*head, *readings))

    def row(self, names: tuple[str, ...] | None) -> Row:
        values = (*map(float, self.closed), *(None if reading is None else float(reading) for reading in self.readings))
        return Row(names, values, self.clock_us / 1e6, sequence=self.sequence)


board_names = st.text(st.characters(categories=("L", "N", "P", "S"), exclude_characters=",*$"), min_size=1)
readings = st.lists(st.none() | st.integers(-(10**9), 10**9), max_size=4).map(tuple)
sent_rows = st.builds(
    Sent,
    st.integers(0, SEQUENCES - 1),
    st.integers(0, CLOCK_US - 1),
    st.lists(st.booleans(), max_size=9).map(tuple),
    readings,
).filter(lambda sent: bool(sent.closed or sent.readings))


@st.composite
def boards(draw: st.DrawFn) -> tuple[LineParser, Sent, tuple[str, ...]]:
    """Return a row, the names of its columns, and a parser that knows them."""
    sent, parser = draw(sent_rows), LineParser()
    columns = len(sent.closed) + len(sent.readings)
    called = tuple(draw(st.lists(board_names, min_size=columns, max_size=columns, unique=True)))
    assert parser.feed(checked(("columns", *called))) == []
    return parser, sent, called


@given(boards())
def test_what_a_board_prints_is_its_row(case: tuple[LineParser, Sent, tuple[str, ...]]) -> None:
    parser, sent, called = case
    assert parsed(checked(("columns", *called)).strip()) == ColumnHeader(called)
    assert parser.feed(sent.line()) == [sent.row(called)]
    assert parser.feed(sent.line().replace(b"\r", b"")) == [sent.row(called)]
    assert LineParser(len(called)).feed(sent.line()) == [sent.row(None)]
    assert parser.counts == LineCounts()


@given(boards(), st.data())
def test_no_change_and_no_loss_of_one_byte_makes_another_row(
    case: tuple[LineParser, Sent, tuple[str, ...]], data: st.DataObject
) -> None:
    """Nor of a line without CR, whose lost end joins it to the next one."""
    parser, sent, called = case
    whole = sent.line().replace(b"\r", b"" if data.draw(st.booleans()) else b"\r")
    place = data.draw(st.integers(0, len(whole) - 1))
    other = data.draw(st.binary(max_size=1))
    rows = parser.feed(whole[:place] + other + whole[place + 1 :] + whole)
    assert len(rows) <= 2
    assert set(rows) <= {sent.row(called)}
    parser.feed(b"\n")
    assert parser.feed(whole) == [sent.row(called)]


@given(boards(), st.binary(max_size=60), st.integers(0, 99))
def test_a_line_without_a_checksum_is_no_row_of_a_board(
    case: tuple[LineParser, Sent, tuple[str, ...]], noise: bytes, at: int
) -> None:
    parser, sent, _ = case
    assert parser.feed(b"\n1,2,3\n" + str(at).encode() + b"\nms,thumb\n" + noise.replace(b"$", b"") + b"\n4,5\n") == []
    assert parser.feed(sent.line())


@pytest.mark.parametrize(
    "fields",
    [
        "row,1,2,5,7,8",  # a switch more than there are
        "row,1,2,03,7,8",
        "row,1,2,,7,8",
        "row,1,2,a,7,8",
        "row,1,2,+1,7,8",
        "row,65536,2,1,7,8",
        "row,1,4294967296,1,7,8",
        "row,-1,2,1,7,8",
        "row,1,2,1,7,8.5",
        "row,1,2,1,7, 8",
        "row,1,2,1,7,8,9,10,11",
        "row,1,2",
        "columns",
        "columns,a,a",
        "columns,a,,b",
        "columns,a,b\0",
    ],
)
def test_a_line_of_another_form_is_damaged(fields: str) -> None:
    parser = LineParser()
    parser.feed(checked(("columns", "a", "b", "c", "d")))
    assert parser.feed(checked(fields.split(","))) == []
    assert parser.counts == LineCounts(damaged=1)
    assert parser.feed(checked(("row", "1", "2", "1", "7", "8")))[0].values == (1, 0, 7, 8)


def test_a_row_before_its_columns_is_left_out_and_begin_forgets_them() -> None:
    parser, row = LineParser(), checked(("row", "1", "2", "1", "7"))
    for _ in range(2):
        assert parser.feed(row) == []
        assert len(parser.feed(checked(("columns", "a", "b")) + row)) == 1
        parser.begin()
    assert parser.counts == LineCounts()
    assert parser.feed(checked(("GPGLL", "1", "N")) + b"$1,2\n") == []
    assert parser.counts.misfits + parser.counts.damaged == 2
    assert isinstance(parsed(b"$row,1"), Damaged)


# Of 10^5 lines: how many count with other content than was sent. XOR misses an even number of lost bytes of one value.
WRONG = {"1 in 100": 358, "two": 3_762, "burst": 93}


@pytest.mark.slow
@pytest.mark.parametrize("pattern", WRONG)
def test_lost_bytes_that_the_checksum_does_not_show(pattern: str) -> None:
    """A row of 16 switches and 8 joints, of which bytes are lost at random, or up to 64 in a row, line ends too."""
    random, parser, wrong = np.random.default_rng(1), LineParser(24), 0
    for number in range(100_000):
        closed, codes = tuple((random.random(16) < 0.5).tolist()), tuple(random.integers(0, 1024, 8).tolist())
        sent = Sent(number % SEQUENCES, number * 5000 % CLOCK_US, closed, codes)
        line = np.frombuffer(sent.line(), dtype=np.uint8)
        if pattern == "burst":
            lost = random.integers(len(line)) + np.arange(random.integers(2, 65))
        elif pattern == "two":
            lost = random.choice(len(line), 2, replace=False)
        else:
            lost = np.flatnonzero(random.random(len(line)) < 0.01)
        rows = parser.feed(np.delete(line, lost[lost < len(line)]).tobytes())
        wrong += any(row != sent.row(None) for row in rows)
    assert wrong == WRONG[pattern]


@pytest.mark.timeout(60)
@pytest.mark.parametrize("line", [b"1" * 8000 + b"e" * 8000, b"a" + b" " * 16_000 + b"b:1"])
def test_a_line_of_garbage_takes_no_time_that_grows_with_its_square(line: bytes) -> None:
    parser = LineParser()
    assert parser.feed((line + b"\n") * 100) == []
    assert parser.counts.misfits == 100
