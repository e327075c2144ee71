"""A reader has little time: README at most 700 words, the pages of docs/ together at most 35,000."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def words(text: str) -> int:
    """Count words; the bars and rules of tables are none."""
    return len(re.sub(r"\||-{2,}", " ", text).split())


def test_the_readme_has_at_most_700_words_table_marks_included() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 700


def test_all_pages_together_have_at_most_35_000_words() -> None:
    pages = {page: words(page.read_text(encoding="utf-8")) for page in (ROOT / "docs").rglob("*.md")}
    assert len(pages) > 30
    assert sum(pages.values()) <= 35_000, sorted(pages.items(), key=lambda item: -item[1])[:5]
