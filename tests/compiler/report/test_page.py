import re
import shlex
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser

import click
import msgspec
import numpy as np
import pytest

from thenar.cli.compile_command import command
from thenar.compiler.frontier.points import Frontier
from thenar.compiler.report.content import ReportContent
from thenar.compiler.report.page import report_html
from thenar.runtime.errors import BuildError

VOID = {"meta", "input", "br", "img", "link", "path", "circle"}


class Page(HTMLParser):
    """A page read as a browser would: elements with attributes, texts, and whether tags close as they opened."""

    def __init__(self, content: bytes) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self._open: list[str] = []
        self.feed(content.decode())
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len(dict(attrs)) == len(attrs)
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def of(self, tag: str) -> Iterator[dict[str, str | None]]:
        return (attributes for name, attributes in self.elements if name == tag)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())


@pytest.fixture(scope="module")
def page(whole: ReportContent) -> Page:
    return Page(report_html(whole))


def test_the_same_content_gives_the_same_bytes(whole: ReportContent) -> None:
    assert report_html(whole) == report_html(whole)


def test_every_section_is_there_and_has_something_to_say(page: Page) -> None:
    links = [attributes["href"] for attributes in page.of("a")]
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(set(ids)) == len(ids)
    assert {link[1:] for link in links if link} <= {name for name in ids if name}
    for said in (
        "recognises 4 grasp types",
        "In the worst case over all possible frames",
        "A whole scan",
        "nested folds",
    ):
        assert said in page.text
    assert "No frontier was given" not in page.text


def sentence_of(content: ReportContent) -> str:
    (said,) = re.findall(r'<p class="sentence">(.*?)</p>', report_html(content).decode())
    return str(said).replace("\N{NO-BREAK SPACE}", " ")


def test_the_first_sentence_gives_the_interval_and_the_luck(whole: ReportContent) -> None:
    rate, sensors = whole.manifest.headline, f"{len(whole.manifest.switches)} of 160 switches and 2 of 2 joints"
    assert rate is not None
    assert rate.low is not None
    assert rate.high is not None
    said = sentence_of(whole)
    interval = f"{100 * rate.rate:.1f} % (95 % interval {100 * rate.low:.1f} to {100 * rate.high:.1f}) of trials"
    assert f"recognises 4 grasp types from {sensors}; new subject: {interval}" in said
    assert said.endswith("No tested row took part in a choice, so no luck of choosing is in this rate.")
    assert whole.frontier is not None
    point = max(whole.frontier.points, key=lambda point: point.luck)
    said = sentence_of(replace(whole, point=point.number))
    assert point.luck > 0
    low, high = 100 * point.rate.low, 100 * point.rate.high
    right = f"{100 * point.rate.mean:.1f} % (95 % interval {low:.1f} to {high:.1f}) ({point.rate.what})"
    assert f"{interval}, and {right} when corrected for luck" in said
    assert f"best of {whole.frontier.combinations:,} combinations" in said


def test_tables_name_the_recipe_of_the_build(whole: ReportContent) -> None:
    captions = re.findall(r"<caption>(.*?)</caption>", report_html(whole).decode())
    (confusion,) = (caption for caption in captions if "rows are true grasp types" in caption)
    assert re.search(r"\(placement: id3, S = 8; trainer: logitboost, .*rounds \d", confusion)
    (kept,) = (caption for caption in captions if caption.startswith("Kept "))
    assert kept.endswith("placement: id3, S = 8")


def test_a_build_that_never_saw_an_empty_hand_says_so(whole: ReportContent) -> None:
    assert "no row shows an empty hand" in Page(report_html(whole)).text


def test_the_page_names_no_other_file(whole: ReportContent) -> None:
    content = report_html(whole)
    assert not re.search(rb"https?://(?!www\.w3\.org/2000/svg)|[\"']//[a-z]|@import|url\((?!#)", content)
    read = Page(content)
    assert not [name for tag, names in read.elements for name in names if name in {"src", "srcset", "action"} and tag]
    assert all((attributes["href"] or "").startswith("#") for attributes in read.of("a"))


def test_names_are_text_and_nothing_else(nasty: ReportContent) -> None:
    content = report_html(nasty)
    read = Page(content)
    assert [attributes.get("type") for attributes in read.of("script")] == ["application/json", "module"]
    assert not list(read.of("img"))
    for name in nasty.manifest.grasps:
        assert " ".join(name.split()) in read.text
    assert "{{ 7 * 7 }}" in read.text


def test_every_table_has_a_caption_and_heads_with_a_scope(page: Page) -> None:
    tables, captions = list(page.of("table")), list(page.of("caption"))
    assert len(tables) == len(captions) == 7
    assert all(attributes.get("scope") in {"col", "row"} for attributes in page.of("th"))


def test_every_picture_says_what_it_is(page: Page) -> None:
    pictures = [attributes for _, attributes in page.elements if attributes.get("role") in {"img", "group"}]
    ids = {attributes["id"] for _, attributes in page.elements if "id" in attributes}
    assert len(pictures) == 1
    assert all(set((attributes["aria-labelledby"] or "").split()) <= ids for attributes in pictures)


def test_the_command_to_make_the_build_again_is_one_that_compile_understands(bare: ReportContent) -> None:
    (said,) = re.findall(r"thenar compile SET.grasps -o build/ --prune.*", report_html(bare).decode())
    known = {flag for parameter in command.get_params(click.Context(command)) for flag in parameter.opts}
    assert {word for word in shlex.split(said) if word.startswith("--")} <= known
    assert "--prune 8 --rounds 4 --inputs both" in said
    assert said.endswith("--glove glove.toml")


def test_a_frontier_of_other_recordings_is_called_so(whole: ReportContent, frontier: Frontier) -> None:
    said = "This frontier belongs to other recordings than the build."
    assert said in Page(report_html(whole)).text
    same = msgspec.structs.replace(frontier, fingerprint=whole.manifest.source.fingerprint)
    assert said not in Page(report_html(replace(whole, frontier=same))).text


def test_omitted_sections_name_the_command_that_adds_them(bare: ReportContent) -> None:
    little = ReportContent(bare.manifest, bare.tables, bare.facts, bare.data)
    text = Page(report_html(little)).text
    for command_line in ("thenar evaluate", "thenar frontier", "--glove glove.toml"):
        assert command_line in text


def test_a_frontier_without_points_is_shown_as_such(whole: ReportContent, frontier: Frontier) -> None:
    empty = msgspec.structs.replace(frontier, points=(), picked=None, tried=(), marks=())
    assert "This frontier has no points." in Page(report_html(replace(whole, frontier=empty))).text


def test_parts_that_do_not_belong_together_are_refused(bare: ReportContent) -> None:
    with pytest.raises(BuildError, match="confusion matrix of 4 grasp types has the shape"):
        replace(bare, confusion=np.zeros((3, 3), np.intp))
    with pytest.raises(BuildError, match="has no harness"):
        replace(bare, harness=None)
    assert bare.hand is not None
    with pytest.raises(BuildError, match="lacks a kept switch"):
        replace(bare, hand=replace(bare.hand, names=tuple(f"x{number}" for number in range(160))))
