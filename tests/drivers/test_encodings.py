"""Encodings of lines that makers print: what is written in one comes back, and garbage loses only what it touches."""

import json
from datetime import UTC, datetime, timedelta
from functools import reduce
from operator import xor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.lines import FINGERS, OPENGLOVES, LineParser, Row, parsed

FLEXION = [f"flex_{finger}" for finger in FINGERS]
BUTTONS = OPENGLOVES[-8:]
counts = st.integers(0, 4095)
values = st.lists(st.floats(-1e6, 1e6).map(lambda number: round(number, 3)), min_size=2, max_size=8)


@st.composite
def gloves(draw: st.DrawFn) -> dict[str, int]:
    """Return readings of a glove that speaks OpenGloves: flexion, buttons, and some of the others."""
    some = draw(st.sets(st.sampled_from(OPENGLOVES)))
    there = [name for name in OPENGLOVES if name in some or name in FLEXION or name in BUTTONS]
    return {name: draw(st.integers(0, 1) if name in BUTTONS else counts) for name in there}


def alpha(glove: dict[str, int]) -> str:
    """Write readings as the firmware of LucidGloves does: a button has a letter only while it is pressed."""
    letters = dict(zip(OPENGLOVES, [*"ABCDEFGP", *(f"({finger}B)" for finger in "ABCDE"), *"HIJKLMNO"], strict=True))
    pressed = {name: letters[name] * count for name, count in glove.items() if name in BUTTONS}
    return "".join(pressed.get(name, f"{letters[name]}{count}") for name, count in glove.items())


@given(st.lists(gloves(), min_size=1, max_size=6), st.data())
def test_alpha_comes_back_and_garbage_loses_only_what_it_touches(
    sent: list[dict[str, int]], data: st.DataObject
) -> None:
    garbage = st.binary(max_size=30).map(lambda noise: noise.replace(b"\n", b"").replace(b"\r", b"") + b"#\n")
    stream = b"".join(data.draw(garbage | st.just(b"")) + alpha(glove).encode() + b"\r" for glove in sent)
    rows = [row for row in LineParser().feed(stream) if row.names and row.names[0] == "flex_thumb"]
    assert [dict(zip(row.names or (), row.values, strict=True)) for row in rows] == sent


@given(st.lists(counts, min_size=7, max_size=7), st.lists(st.integers(0, 1), min_size=6, max_size=6))
def test_legacy_comes_back_with_the_same_names(analog: list[int], pressed: list[int]) -> None:
    row = Row((*OPENGLOVES[:7], *BUTTONS[:6]), tuple(map(float, [*analog, *pressed])))
    assert parsed("&".join(map(str, [*analog, *pressed])).encode()) == row


def nmea(text: str) -> str:
    return f"${text}*{reduce(xor, text.encode(), 0):02x}"


FORMS = [nmea, "<{}>".format, "DATA: {}".format, "DATA,{}".format, lambda text: nmea(f"GLV,{text}")]


@pytest.mark.parametrize("unit", ["", "deg", "V", " °C", "%", "mA", "kOhm", "m/s^2", "rad/s"])
@given(numbers=values, form=st.sampled_from(FORMS), sign=st.sampled_from([":", "=", " = "]))
def test_frames_words_and_units_change_nothing(unit: str, numbers: list[float], form: "type[str]", sign: str) -> None:
    assert parsed(form(",".join(f"{number!r}{unit}" for number in numbers)).encode()) == Row(None, tuple(numbers))
    named = {f"a{place}": number for place, number in enumerate(numbers)}
    written = ", ".join(f"{name}{sign}{number!r}{unit}" for name, number in named.items())
    assert parsed(written.encode()) == Row(tuple(named), tuple(numbers))


@given(st.lists(counts, min_size=1, max_size=8), st.lists(st.booleans(), min_size=1), st.sampled_from("xX"))
def test_hexadecimal_numbers_and_truths_come_back(numbers: list[int], truths: list[bool], x: str) -> None:
    written = [*(f"0{x}{number:03X}" for number in numbers), *map(str, truths)]
    for line in (",".join(written), " ".join(word.lower() for word in written)):
        assert parsed(line.encode()) == Row(None, tuple(map(float, [*numbers, *truths])))


@given(st.datetimes(datetime(1970, 1, 2), datetime(2100, 1, 1)), st.integers(-12, 12), counts)
def test_times_are_seconds(date: datetime, zone: int, number: int) -> None:
    written = date.isoformat()
    for mark, hours in (("", 0), ("Z", 0), (f"{zone:+03}:00", zone)):
        wanted = (date - timedelta(hours=hours)).replace(tzinfo=UTC).timestamp()
        assert parsed(f"{written}{mark},{number}".encode()) == Row(None, (wanted, number))
        assert parsed(f"t:{written}{mark} a:{number}".encode()) == Row(("t", "a"), (wanted, number))
    midnight = date - datetime(date.year, date.month, date.day)
    assert parsed(f"{written[11:]},{number}".encode()) == Row(None, (midnight / timedelta(seconds=1), number))


leaves = st.floats(-1e6, 1e6) | st.booleans() | st.none()
keys = st.sampled_from("abcde")


@given(
    st.dictionaries(keys, st.dictionaries(keys, st.lists(leaves)), min_size=1), leaves, st.sampled_from(["", "DATA: "])
)
def test_nested_json_has_names_with_dots(sent: dict[str, dict[str, list[float]]], top: float | None, word: str) -> None:
    wanted: dict[str, float | None] = {"top": top}
    for name, some in sent.items():
        wanted |= {f"{name}.{key}.{place}": leaf for key, found in some.items() for place, leaf in enumerate(found)}
    line = f"{word}{json.dumps({'top': top} | sent)}"
    assert parsed(line.encode()) == Row(tuple(wanted), tuple(wanted.values()))


def test_once_a_line_had_a_checksum_others_are_no_rows_and_none_is_once_a_board_spoke() -> None:
    parser = LineParser()
    assert parser.feed(f"1,2\n{nmea('1,2')}\n3,4\n".encode()) == 2 * [Row(None, (1, 2))]
    assert parser.feed(f"{nmea('columns,a')}\n{nmea('1,2')}\n{nmea('row,0,5,1')}\n".encode()) == [
        Row(("a",), (1.0,), 5e-6, sequence=0)
    ]
    assert parser.counts.misfits == 2
