"""The page on the architecture is short, and everything that it names exists."""

import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "project" / "architecture.md").read_text(encoding="utf-8")


def test_the_page_has_at_most_500_words() -> None:
    assert len(re.sub(r"[|]|-{2,}", " ", PAGE).split()) <= 500


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`(thenar[.\w]+)`", PAGE))))
def test_every_name_exists(name: str) -> None:
    module, _, last = name.rpartition(".")
    if last[0].isupper() or last in ("select", "compile_build"):
        assert hasattr(import_module(module), last)
    else:
        import_module(name)


def test_every_file_exists() -> None:
    for path in re.findall(r"`(tests/[\w/.]+)`", PAGE):
        assert (ROOT / path).exists()
