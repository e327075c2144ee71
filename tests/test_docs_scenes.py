"""docs/reference/scenes.md, and the page made of effects, against the structs that decode a scene: every key, default
and limit.
"""

import json
import re
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import msgspec
import pytest

from thenar.simulator.body.shapes import Box, Cylinder, Sphere
from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.pipeline.scene_file import _SceneFile
from thenar.simulator.scenes.scene import SURVEYS, Recording, SceneGlove, SceneObject, Subject, SurveyPopulation

NAMES = tuple(EFFECTS)

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "reference" / "scenes.md").read_text(encoding="utf-8")

Documented = dict[str, dict[str, str]]  # key -> column -> cell


def table(heading: str) -> list[dict[str, str]]:
    """Return the rows of the table whose heading begins with `heading`; a cell left empty has the one above."""
    lines = PAGE[PAGE.index(f"\n| {heading}") + 1 :].split("\n\n")[0].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split(" |")] for line in lines]
    return [dict(zip(cells[0], row, strict=True)) for row in cells[2:]]


def keyed(rows: list[dict[str, str]], column: str) -> Documented:
    """Return rows by the keys that `column` names, which may be several."""
    return {key: row for row in rows for key in re.findall(r"`([\w.]+)`", row[column].partition(":")[0])}


def metas(annotation: Any) -> Iterator[msgspec.Meta]:
    if get_origin(annotation) is Annotated:
        yield from (extra for extra in annotation.__metadata__ if isinstance(extra, msgspec.Meta))
        yield from metas(annotation.__origin__)
    elif get_origin(annotation) is not tuple:  # what a list holds is no limit of the list
        for inside in get_args(annotation):
            yield from metas(inside)


def limits(kind: type[msgspec.Struct], key: str) -> str:
    """Return what the struct says of the limits of a key, in the words of the page."""
    found = list(metas(get_type_hints(kind, include_extras=True)[key]))
    if not found:
        return ""
    meta = found[0]
    if meta.min_length is not None:
        return {1: "at least one"}[meta.min_length]
    if meta.lt is not None:
        return f"between {meta.gt:g} and {meta.lt:g}"
    if meta.gt is not None:
        return f"above {meta.gt:g}" + ("" if meta.le is None else f", at most {number(meta.le)}")
    return f"from {meta.ge:g}" if meta.le is None else f"{number(meta.ge)} to {number(meta.le)}"


def number(value: float | None) -> str:
    return {2**63 - 1: "2^63 - 1", 1e6: "10^6"}.get(value or 0, f"{value:.15g}")


def default(kind: type[msgspec.Struct], key: str) -> object:
    return next(field.default for field in msgspec.structs.fields(kind) if field.name == key)


def shown(value: object) -> set[str]:
    """Return how the page may write a default."""
    if value is msgspec.NODEFAULT:
        return {"required", ""}
    if value is None:
        return {"drawn", "1"}
    if value == ():
        return {"none"}
    if isinstance(value, str | bool):
        return {f"`{json.dumps(value)}`"}
    return {str(value), f"{value:g}"}


def test_every_effect_is_on_the_page_and_none_that_is_not_there() -> None:
    assert sorted(keyed(table("effects | simulate"), "effects")) == sorted(NAMES)


@pytest.fixture
def generated(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return the names of the hook that makes the page of effects."""
    return runpy.run_path(str(DOCS / "generated_pages.py"))


@pytest.mark.parametrize("name", NAMES)
def test_the_generated_page_has_every_parameter_with_its_default_and_limits(
    name: str, generated: dict[str, Any]
) -> None:
    kind = EFFECTS[name].parameters()
    start = rf"^## {re.escape(name)}\n\n(.*?)(?=^## |\Z)"
    (section,) = re.findall(start, generated["effects"](), re.DOTALL | re.MULTILINE)
    found = {key: cells for key, *cells in re.findall(r"^\| `(\w+)` \| (.*) \| (.*) \|$", section, re.MULTILINE)}
    assert found.keys() == {*kind.__struct_fields__}
    hints = get_type_hints(kind, include_extras=True)
    for key, (value, limit) in found.items():
        assert value in shown(default(kind, key)), key
        ends = (end for meta in metas(hints[key]) for end in (meta.ge, meta.gt, meta.le, meta.lt))
        assert set(re.findall(r"\d\S*", limit)) == {f"{end:g}" for end in ends if end is not None}, key


TABLES: dict[str, type[msgspec.Struct]] = {
    "key of `[recording]`": Recording,
    "key of `[glove]`": SceneGlove,
    "key of `[population]`": SurveyPopulation,
    "key of `[[subjects]]`": Subject,
}


@pytest.mark.parametrize("heading", TABLES)
def test_scene_tables_have_the_pages_keys_defaults_and_limits(heading: str) -> None:
    kind, documented = TABLES[heading], keyed(table(heading), heading)
    assert documented.keys() == {*kind.__struct_fields__}
    for key, row in documented.items():
        assert row.get("default", "").partition(" (")[0] in shown(default(kind, key)) | {""}, key
        assert row["limits"] == limits(kind, key) or key == "name", key


def test_the_keys_of_an_object_are_those_of_the_page() -> None:
    heading = "key of `[[objects]]`"
    documented = keyed(table(heading), heading)
    shapes = {key: kind for kind in (Sphere, Cylinder, Box) for key in kind.__struct_fields__}
    assert documented.keys() == {*SceneObject.__struct_fields__, *shapes}
    assert documented["mass_g"]["limits"] == limits(SceneObject, "mass_g")
    for key, kind in shapes.items():
        assert documented[key]["default"] in shown(default(kind, key)), key
        assert documented[key]["limits"] == limits(kind, key) or key == "edge_mm", key


def test_the_keys_of_a_scene_are_those_of_the_page() -> None:
    documented = keyed(table("key | meaning"), "key")
    # [effects.GROUP.NAME] stands for `effects`.
    assert {key for key in documented if key.islower()} >= {*_SceneFile.__struct_fields__} - {
        *("subjects", "population", "recording", "glove", "effects")
    }
    assert documented["seed"]["limits"] == limits(_SceneFile, "seed")
    assert documented["repetitions"]["limits"] == limits(_SceneFile, "repetitions")


def test_the_surveys_are_those_of_the_page() -> None:
    rows = {row["mm, mean ± standard deviation"].strip("`"): list(row.values())[1:] for row in table("mm, mean")}
    assert rows.keys() == SURVEYS.keys()
    for survey, (men, women) in SURVEYS.items():
        spreads = (men[0], women[0], men[1], women[1])
        cells = [cell.removesuffix(" (ours)") for cell in rows[survey]]
        assert cells == [f"{spread.mean:.1f} ± {spread.sd:g}" for spread in spreads]
