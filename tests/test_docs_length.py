"""README has at most 600 words, docs/ 25,000, the page on the architecture 500; and all that this page names exists."""

import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def words(text: str) -> int:
    """Count words; the bars and rules of tables are none."""
    return len(re.sub(r"\||-{2,}", " ", text).split())


def test_the_readme_has_at_most_600_words_table_marks_included() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 600


def test_all_pages_together_have_at_most_25_000_words() -> None:
    pages = {page: words(page.read_text(encoding="utf-8")) for page in (ROOT / "docs").rglob("*.md")}
    assert len(pages) > 30
    assert sum(pages.values()) <= 25_000, sorted(pages.items(), key=lambda item: -item[1])[:5]


ARCHITECTURE = (ROOT / "docs" / "project" / "architecture.md").read_text(encoding="utf-8")


def test_the_architecture_has_at_most_500_words() -> None:
    assert len(re.sub(r"[|]|-{2,}", " ", ARCHITECTURE).split()) <= 500


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`(thenar[.\w]+)`", ARCHITECTURE))))
def test_every_name_exists(name: str) -> None:
    module, _, last = name.rpartition(".")
    if last[0].isupper() or last in ("select", "compile_build"):
        assert hasattr(import_module(module), last)
    else:
        import_module(name)


def test_every_file_exists() -> None:
    for path in re.findall(r"`(tests/[\w/.]+)`", ARCHITECTURE):
        assert (ROOT / path).exists()
