"""Lines of numbers, whatever comes between them."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.lines import LONGEST, Header, LineParser, Row, Splitter, parsed

numbers = st.floats(-1e9, 1e9).map(lambda number: round(number, 6))
rows = st.lists(numbers, min_size=2, max_size=8)
names = st.lists(st.from_regex(r"[a-z][a-z_0-9]{0,6}", fullmatch=True), min_size=8, max_size=8, unique=True).filter(
    lambda found: not {"nan", "inf", "null", "none", "na"} & set(found)
)


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", "])
@given(values=rows)
def test_a_row_is_parted_by_what_people_part_rows_by(separator: str, values: list[float]) -> None:
    assert parsed(separator.join(map(repr, values)).encode()) == Row(None, tuple(values))


@given(values=rows, called=names)
def test_rows_that_name_their_values(values: list[float], called: list[str]) -> None:
    named = dict(zip(called, values, strict=False))
    row = Row(tuple(named), tuple(values))
    assert parsed(",".join(f"{name}:{value!r}" for name, value in named.items()).encode()) == row
    assert parsed(json.dumps(named).encode()) == row
    assert parsed(json.dumps(values).encode()) == Row(None, tuple(values))


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
        (b'{"a": true, "b": null, "c": [1], "d": 1e999, "e": NaN}', (1, *[None] * 4)),
        (b"\xef\xbb\xbf7 8", (7, 8)),
        (b'"1","2"', (1, 2)),
        (b'{"a": "1", "b": " -2.5", "c": "on", "d": {"e": 1}}', (1, -2.5, None, None)),
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
        b"0x10,2",
        b"a:1,a:2",
        b":1",
        b"9" * 401 + b"x",
        b"ready",
        b"A512B300C200",
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
    assert parsed(b"ms, thumb tip") == Header(("ms", "thumb tip"))
    assert parser.counts.misfits == 0
    assert parser.feed(b"saved,3 files\nno,more,words\n8,9\nms,thumb\n8,9\n") == 2 * [Row(("ms", "thumb"), (8, 9))]
    assert (parser.counts.misfits, parser.odd) == (2, "'no,more,words'")
    parser.begin()
    assert parser.feed(b"1,2\n") == [Row(None, (1, 2))]


def test_lines_of_words_alone_are_misfits_however_many_words_they_have() -> None:
    parser = LineParser(3)
    assert parser.feed(b"A512B300C200\nA513,B301,C201\nA514,B302,C202\nready\n") == []
    assert (parser.counts.misfits, parser.odd) == (4, "'ready'")


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
    assert parser.feed(b"ready\n" + row) == [Row(("ms", "flex [deg]", "label"), (5, 1, None))]


@given(st.binary(max_size=200), st.integers(0, 9))
def test_nothing_that_comes_raises(line: bytes, columns: int) -> None:
    parsed(line, columns)


def test_ten_megabytes_without_a_line_feed_fill_no_memory_and_the_next_row_counts() -> None:
    splitter = Splitter()
    for _ in range(160):
        assert splitter.feed(b"7" * 65_536) == []
        assert len(splitter._rest) <= LONGEST
    assert splitter.feed(b"7\n1,2\n") == [b"1,2"]
    assert splitter.overlong == 1
    assert splitter.feed(b"7" * (LONGEST + 1) + b"\n3,4\n") == [b"3,4"]
    assert splitter.overlong == 2
