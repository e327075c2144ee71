"""The page: one file that needs no other, says what the report says, and is the same for the same results."""

import re
from html.parser import HTMLParser

import msgspec
import pytest

from thenar.stability.finding import Case, Finding
from thenar.stability.report import CaseReport, Check, Report
from thenar.stability.shown.figures import draw_weka
from thenar.stability.shown.page import Picture, page
from thenar.stability.weka import Comparison, Differences, NotRun

VOID = {"meta", "br", "hr", "img", "link"}
NAMESPACES = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}

SOUND = Finding("branch values", "60 digits", 0.51234, 2.0, "ulp", 12000, "row 7 of <b>")
BAD = Finding("no rows & columns", "the rule itself", 3, 0, "rows", 5, "")
REPORT = Report(
    full=False,
    cases=(
        CaseReport(
            "sound", Case("A sound case", "nothing <script>alert(1)</script>"), (Check(SOUND, True),), None, True
        ),
        CaseReport("bad", Case("A bad case", "all & sundry"), (Check(BAD, False),), "ValueError: 1 < 2", False),
    ),
    weka=NotRun("java or Weka is not installed"),
    holds=False,
)
APART = Differences((1e-16, 0.0, 1.0), 3)
COMPARISON = Comparison(
    "3.6.14", 3, 2, 4, 8, 8, 1, APART, APART, Differences((1e-15, 1e-14, 1e-13), None), 2, 193.7, 3.0, 10, 0.0
)
DRAWN = draw_weka(COMPARISON)
FIGURES = tuple(Picture(name, f"Picture {name}.", "How to read <it>.", DRAWN) for name in ("one", "two"))


class Reader(HTMLParser):
    """Reads a page as a browser would: the elements with their attributes, the words, and what was never closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words = ""
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
        self.words += " " if tag in ("td", "th") else ""

    def handle_data(self, data: str) -> None:
        self.words += data

    def all(self, attribute: str) -> list[str]:
        return [value for _, attributes in self.elements if (value := attributes.get(attribute)) is not None]


@pytest.fixture(scope="module")
def text() -> str:
    return page(REPORT, FIGURES)


def test_every_element_is_closed_where_it_should_be(text: str) -> None:
    assert Reader(text).open == []


def test_nothing_is_loaded_from_elsewhere(text: str) -> None:
    read = Reader(text)
    assert not {tag for tag, _ in read.elements} & {"script", "link", "img", "iframe", "object", "base"}
    assert not read.all("src")
    assert all(target.startswith("#") for target in read.all("href") + read.all("xlink:href"))
    assert set(re.findall(r"https?://[^\s\"'<>)]+", text)) <= NAMESPACES
    assert "@import" not in text
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", text))


def test_every_link_leads_somewhere_and_every_name_is_one_things(text: str) -> None:
    read = Reader(text)
    names = read.all("id")
    assert len(names) == len(set(names))
    assert {target[1:] for target in read.all("href") + read.all("xlink:href")} <= set(names)
    assert set(re.findall(r"url\(#([^)]*)\)", text)) <= set(names)


def test_what_a_case_says_is_text_and_no_markup(text: str) -> None:
    read = Reader(text)
    assert "nothing <script>alert(1)</script>" in read.words
    assert "worst: row 7 of <b>" in read.words
    assert "FAILED: ValueError: 1 < 2" in read.words
    assert "How to read <it>." in read.words


def test_the_table_holds_every_check_with_error_bound_and_verdict(text: str) -> None:
    words = " ".join(Reader(text).words.split())
    assert "branch values worst: row 7 of <b> 60 digits 12,000 0.512 ulp 2 ulp holds" in words
    assert "no rows & columns the rule itself 5 3 rows 0 rows FAILS" in words
    assert words.count("What could go wrong:") == 2


def test_units_that_do_not_speak_for_themselves_are_explained(text: str) -> None:
    terms = Reader(text).words.split("in the same unit:")[1].split("Check")[0].split("\n")
    assert [term.strip() for term in terms if term.strip()] == [
        "ulpthe distance from the true number to the next double"
    ]


def test_the_sum_stands_at_the_top_and_names_what_fails(text: str) -> None:
    words = Reader(text).words
    assert "2 cases quickly, 2 checks on 12,005 inputs: NOT all hold, see bad" in words
    assert words.index("bad: no rows & columns: 3 rows against a bound of 0 rows") < words.index("Pictures")
    assert words.index("bad: ValueError: 1 < 2") < words.index("Pictures")
    held = msgspec.structs.replace(REPORT, cases=REPORT.cases[:1], holds=True, full=True)
    assert "1 case in full, 1 check on 12,000 inputs: all hold" in Reader(page(held, ())).words


def test_weka_that_is_missing_is_named(text: str) -> None:
    assert "not run: java or Weka is not installed" in Reader(text).words


def test_the_round_in_which_weka_parts_from_itself_is_named_in_words_and_picture() -> None:
    read = Reader(page(msgspec.structs.replace(REPORT, weka=COMPARISON), FIGURES))
    assert (
        "JVM: at most 1e-16 until they diverge in round 3, then up to 1; after the last round 2 rows of 8 change"
        in read.words
    )
    assert "the processor's exp(), the default: at most 1e-16 until they diverge in round 3, then up to 1" in read.words
    assert "Java's portable exp(): at most 1e-13, in all rounds" in read.words
    assert "in 10 other orders: the same bits" in read.words


def test_a_picture_says_what_it_is_to_those_who_cannot_see_it(text: str) -> None:
    pictures = [attributes for tag, attributes in Reader(text).elements if tag == "svg"]
    assert [(each["role"], each["aria-label"]) for each in pictures] == [
        ("img", "Picture one."),
        ("img", "Picture two."),
    ]


def test_the_same_results_give_the_same_bytes_without_a_date(text: str) -> None:
    again = tuple(Picture(each.name, each.title, each.caption, draw_weka(COMPARISON)) for each in FIGURES)
    assert page(REPORT, again) == text
    assert not re.search(r"20\d\d-\d\d|20\d\d", re.sub(r"<svg.*?</svg>", "", text, flags=re.S))
