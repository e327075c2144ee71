"""docs/reference/python/index.md: its table is made of the names that can be imported, and its examples name such.

The page of file layouts is made of docstrings that describe them.
"""

import re
import runpy
from pathlib import Path

import thenar.compiler
import thenar.runtime

DOCS = Path(__file__).parents[1] / "docs"
INDEX = DOCS / "reference" / "python" / "index.md"
START = "| function |"


def test_the_tables_are_those_of_the_code(update_golden: bool) -> None:
    """Each function with the arguments that it needs, each class, and the first sentence of its docstring."""
    page = INDEX.read_text(encoding="utf-8")
    head, start, _ = page.partition(START)
    assert start or update_golden
    today = head + runpy.run_path(str(DOCS / "generated_pages.py"))["api_tables"]()
    if update_golden:
        INDEX.write_text(today, encoding="utf-8")
    assert update_golden or page == today


def test_every_name_is_on_the_page() -> None:
    page = INDEX.read_text(encoding="utf-8")
    named = set(re.findall(r"`(?:thenar\.runtime\.)?(\w+)(?:\([^`]*\))?`", page))
    assert {*thenar.compiler.__all__, *thenar.runtime.__all__} <= named


def test_the_examples_import_what_is_there() -> None:
    found = re.findall(
        r"^from thenar\.(compiler|runtime) import (.*)$", INDEX.read_text(encoding="utf-8"), re.MULTILINE
    )
    rooms = {"compiler": thenar.compiler, "runtime": thenar.runtime}
    assert {room for room, _ in found} == rooms.keys()
    for room, names in found:
        assert {*names.split(", ")} <= {*rooms[room].__all__}


def test_the_page_of_layouts_describes_each_binary_file() -> None:
    layouts = runpy.run_path(str(DOCS / "generated_pages.py"))["layouts"]()
    for words in (
        "SHA-256 of bytes 0..23",
        "thresholds, uint16, joint after",
        "Format 1, LogitBoost",
        "switches  (n, ",
    ):
        assert words in layouts
    page = (DOCS / "reference" / "files.md").read_text(encoding="utf-8")
    for module in re.findall(r"`((?:runtime|compiler)/[\w/]+\.py)`", page):
        assert (DOCS.parent / module).exists()
