"""The section on the Pareto front: its charts, its points, the details of the picked one, and tables."""

import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

import msgspec
from msgspec import Struct

from thenar.drivers.extras import optional

from ..evaluation.rates import interval
from ..frontier.plots import POINT_ID, RING_ID, pictures
from ..frontier.points import Frontier, FrontierPoint, PointTime
from ..frontier.words import (
    LUCK,
    counted_of,
    elements_of,
    featured,
    folds_of,
    inputs_of,
    of_time,
    rates_of,
    summary,
    trainer_of,
    way_of,
    wiring_of,
)
from ..hand import HandShape
from ..pictures import PALETTE
from ..text import DASH, NBSP, counted, microseconds, sentence
from .content import HandPicture, PlainTable, hand_picture

with optional():
    from markupsafe import Markup

_FOREIGN = "This frontier belongs to other recordings than the build."
_CAPTIONS = {
    "frontier": "Accuracy against frame time, both in the table below.",
    "switches": (
        "Accuracy against the number of switches. Curves use switches only. Points without switches are not shown."
    ),
}
# If a colour has two names, the first.
_COLOURS = {colour: f"var(--{name})" for name, (colour, _) in reversed(list(PALETTE.items()))}
_TARGET = "9"  # radius of the clickable area, in units of the charts


class PointDetail(Struct, frozen=True):
    """The details of a picked point: a sentence, names and values, its switches, their numbers on the drawn hand, and
    the command that builds it.
    """

    number: int
    said: str
    facts: tuple[tuple[str, str], ...]
    switches: tuple[str, ...]
    on_hand: tuple[int, ...]
    command: str


@dataclass(frozen=True, slots=True)
class FrontierView:
    """The content of the section; hand is None where the switches' positions are unknown.

    charts  the id, the caption and the SVG of each
    """

    charts: tuple[tuple[str, str, Markup], ...]
    points: PlainTable
    details: tuple[PointDetail, ...]
    picked: PointDetail | None
    hand: HandPicture | None
    tables: tuple[PlainTable, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]


def frontier_view(
    frontier: Frontier, fingerprint: str, hand: HandShape | None, built: int | None = None
) -> FrontierView:
    """Return the section on `frontier` for a build from the recordings with that fingerprint, which is point `built`.

    Raises PictureError without matplotlib.
    """
    if hand is not None and not all(hand.knows(point.switches) for point in frontier.points):
        hand = None
    details = {point.number: _detail(point, frontier, hand) for point in frontier.points}
    first = featured(frontier) if built is None else frontier.point(built)
    picked = None if first is None else details[first.number]
    title = "Switches of the picked point on the hand"
    return FrontierView(
        charts=() if picked is None else tuple(_charts(frontier, details, picked)),
        points=_points(frontier),
        details=tuple(details.values()),
        picked=picked,
        hand=(
            None
            if hand is None or picked is None
            else hand_picture(hand, picked.switches, "picked-hand", title, picked.said)
        ),
        tables=tuple(_tables(frontier)),
        warnings=() if frontier.fingerprint == fingerprint else (_FOREIGN,),
        notes=(*_notes(frontier), *(() if built is None else (f"This build is point {built}.",))),
    )


def _charts(
    frontier: Frontier, details: Mapping[int, PointDetail], picked: PointDetail
) -> Iterator[tuple[str, str, Markup]]:
    drawn = pictures(msgspec.structs.replace(frontier, picked=picked.number), "svg", letters=True)
    for name, svg in drawn.items():
        ident = f"by-{name}"
        yield ident, _CAPTIONS[name], _embedded(svg, ident, details, picked.number)


def _embedded(svg: bytes, ident: str, details: Mapping[int, PointDetail], picked: int) -> Markup:
    """Return an SVG file as a part of a page, in the page's colours; its points are clickable and have titles.

    Only ids that are referenced are kept, prefixed with `ident`.
    """
    root = ElementTree.fromstring(svg)
    referred = set(re.findall(r'(?:href="|url\()#([^")]+)', svg.decode()))
    for part in list(root.iter()):
        for child in list(part):
            if child.tag.endswith("}metadata") or child.get("id") == RING_ID or child.find("{*}style") is not None:
                part.remove(child)
        _translate(part, ident, referred)
        number = part.get("data-point")
        if number is not None:
            _make_point(part, details[int(number)].said, number == str(picked))
    root.attrib = {"viewBox": root.attrib["viewBox"], "role": "img", "aria-labelledby": f"{ident}-caption"}
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _translate(part: ElementTree.Element, ident: str, referred: set[str]) -> None:
    """Rewrite an element of an SVG file for a page: no namespaces, prefixed ids, named colours."""
    part.tag = part.tag.rpartition("}")[2]
    given, part.attrib = part.attrib, {}
    for name, value in given.items():
        name = name.rpartition("}")[2]
        if name == "id":
            if value.startswith(POINT_ID):
                part.set("data-point", value.removeprefix(POINT_ID))
            if value in referred:
                part.set("id", f"{ident}-{value}")
        elif name == "style":
            part.set(name, re.sub(r"#[0-9a-f]{6}\b", lambda found: _COLOURS.get(found[0], found[0]), value))
        else:
            part.set(name, re.sub(r"^(url\()?#", rf"\1#{ident}-", value))


def _make_point(marker: ElementTree.Element, said: str, picked: bool) -> None:
    (place,) = marker.iterfind(".//{*}use")
    marker.set("class", "point picked" if picked else "point")
    title = ElementTree.Element("title")
    title.text = said
    marker.insert(0, title)
    circle = {"class": "target", "cx": place.attrib["x"], "cy": place.attrib["y"], "r": _TARGET}
    ElementTree.SubElement(marker, "circle", circle)


def _detail(point: FrontierPoint, frontier: Frontier, hand: HandShape | None) -> PointDetail:
    setting = point.setting
    what = (inputs_of(frontier, point), setting.placement.method, trainer_of(setting), f"{setting.width} bits")
    words = ", ".join(filter(None, (*what, _wiring(point))))
    return PointDetail(
        number=point.number,
        said=f"Point {point.number}: {words}; {point.rate} in {_time(point.frame)}.",
        facts=tuple(_facts(point, frontier)),
        switches=point.switches,
        on_hand=() if hand is None else tuple(hand.numbers_of(point.switches).tolist()),
        command=(
            f"thenar compile {shlex.quote(frontier.source)} -o build/ "
            f"--from frontier/frontier.json --point {point.number}"
        ),
    )


def _facts(point: FrontierPoint, frontier: Frontier) -> Iterable[tuple[str, str]]:
    setting = point.setting
    for what, rate in rates_of(frontier).items():
        yield f"Accuracy in %, {what}", interval(rate(point))
    yield "Subtracted for selection", f"{100 * point.luck:.1f} points"
    yield "Placement", _placement(point)
    yield "Inputs", f"{setting.inputs}, {counted(len(point.switches), 'switch', 'switches')}"
    yield "Wiring", f"{_wiring(point)}; {counted(point.ports, 'port')}, {counted(point.chips, 'chip')}"
    yield "Tables", f"{trainer_of(setting)}, {setting.width} bits"
    yield "Scan", _time(point.scan) if point.switches else DASH
    yield "Joints", DASH if setting.inputs == "switches" else _time(point.transfer)
    yield "Classify", _time(point.classify)
    yield "Frame", _time(point.frame)
    yield "Flash and RAM", f"{point.flash:,} and {point.ram:,} bytes"


def _placement(point: FrontierPoint) -> str:
    return way_of(point.setting) if point.switches else DASH


def _wiring(point: FrontierPoint) -> str:
    return wiring_of(point.setting) or point.setting.wiring


def _time(time: PointTime) -> str:
    return "unknown, not included" if time.how == "unknown" else f"{microseconds(time.us)} µs ({time.how})"


def _points(frontier: Frontier) -> PlainTable:
    columns = (
        "Point",
        counted_of(frontier).capitalize(),
        "Inputs",
        "Method",
        "Trainer",
        *rates_of(frontier),
        of_time(frontier, "Frame, µs"),
        "Flash, bytes",
    )
    rows = tuple(
        (
            str(point.number),
            str(point.size),
            point.setting.inputs,
            _placement(point),
            trainer_of(point.setting),
            *(interval(rate(point)) for rate in rates_of(frontier).values()),
            microseconds(point.frame.us),
            f"{point.flash:,}",
        )
        for point in frontier.points
    )
    caption = f"Points of the frontier; accuracy in % with 95{NBSP}% intervals"
    return PlainTable(caption, columns, rows, words=(0, 2, 3, 4))


def _tables(frontier: Frontier) -> Iterator[PlainTable]:
    """Yield tables of reference points and of curves, where there are any."""
    kept, trainer = elements_of(frontier).capitalize(), "".join(frontier.trainers[:1]) or "none"
    if frontier.marks:
        marks = tuple(
            (mark.name, str(mark.n_switches), interval(mark.rate), microseconds(mark.frame_us))
            for mark in frontier.marks
        )
        caption = f"Reference points; trainer: {trainer}, that of a build as compiled"
        yield PlainTable(caption, ("What", kept, f"{frontier.by}, %", of_time(frontier, "Frame, µs")), marks)
    if frontier.curves:
        sizes = sorted({size for curve in frontier.curves for size in curve.sizes})
        rows = []
        for curve in frontier.curves:
            rates = dict(zip(curve.sizes, curve.rates, strict=True))
            cells = (f"{100 * rates[size].mean:.1f}" if size in rates else "" for size in sizes)
            rows.append((curve.method, curve.what, *cells))
        columns = ("Method", "Description", *(f"{size:g}" for size in sizes))
        what = f"Accuracy in % ({frontier.by}, trials), {elements_of(frontier)} only, against their number"
        yield PlainTable(f"{what}; trainer: {trainer}", columns, tuple(rows), words=(0, 1))


def _notes(frontier: Frontier) -> Iterator[str]:
    yield summary(frontier)
    taxels = f"{counted(frontier.n_taxels, 'taxel')} of {frontier.n_levels} levels, " if frontier.n_taxels else ""
    yield (
        f"{frontier.combinations:,} combinations of {frontier.source}: {counted(frontier.rows, 'row')}, "
        f"{counted(frontier.trials, 'trial')}, "
        f"{counted(frontier.subjects, 'subject')}, {counted(frontier.n_switches, 'switch', 'switches')}, "
        f"{taxels}{counted(frontier.n_joints, 'joint')}; times on {frontier.machine}. "
        f"{folds_of(frontier)}, placement inside the fold, with 95{NBSP}% intervals. {LUCK}"
    )
    if frontier.wanted and frontier.picked is not None:
        yield f"Point {frontier.picked} was picked for {frontier.wanted}."
    yield from map(sentence, frontier.skipped)
