"""docs/how-to/own-board.md: its harnesses are loaded, its lines are rows, its counts are those that health shows."""

import re
from dataclasses import fields
from pathlib import Path

from thenar.drivers.lines import LONGEST, ColumnHeader, LineCounts, Row, parsed
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.sinks.base import SINKS
from thenar.runtime.sources.base import SOURCES
from thenar.runtime.sources.rows import _TAXEL_STEPS, JOINT_CODES, RowCounts, RowKind, kind_of

PAGE = (Path(__file__).parents[1] / "docs" / "how-to" / "own-board.md").read_text(encoding="utf-8")


def cells(heading: str) -> list[str]:
    """Return the first cells of the table whose heading begins so."""
    table = PAGE[PAGE.index(f"\n| {heading}") + 1 :].split("\n\n")[0].splitlines()[2:]
    return [line.replace("\\|", "").strip("|").split("|")[0].strip() for line in table]


def test_its_harnesses_are_sound() -> None:
    (whole,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert parse_harness(whole, "glove.toml").streams[0].used == ("thumb", "index", "flex_index", "pad_palm")
    (ros,) = re.findall(r"    \[\[stream\]\]\n    port = \"ros.*\n.*\n", PAGE)
    assert parse_harness(re.sub("(?m)^    ", "", ros), "glove.toml").sensor_names == ("index", "ring")


def test_its_lines_are_rows() -> None:
    found = [parsed(text.strip("`").encode()) for text in cells("line")]
    assert [type(one) for one in found] == [Row, ColumnHeader, *[Row] * 6]


def test_every_count_and_every_way_is_there() -> None:
    named = {name.strip() for cell in cells("count") for name in cell.split(",")}
    counts = {field.name.replace("_", " ") for kind in (RowCounts, LineCounts) for field in fields(kind)}
    assert named == counts | {"rows a second"}
    ports = [port.strip("` ") for cell in cells("`port`") for port in cell.split(", ")]
    kinds = [kind for kind in SOURCES.values() if isinstance(kind, RowKind)]
    assert {kind_of(port) for port in ports} == {kind.name for kind in kinds}
    assert "lsl" in SINKS


def test_its_numbers_are_the_codes() -> None:
    first, last = JOINT_CODES
    for words in (f"{LONGEST:,}", f"{_TAXEL_STEPS} steps", f"{first} + round({last - first} * (number - a) / (b - a))"):
        assert words in PAGE
