"""Catalogues of objects: at least one for every grasp type of a taxonomy."""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import get_args

import msgspec

from thenar.compiler.recordings.errors import RecordingError
from thenar.compiler.recordings.names import fault, list_names, nearest
from thenar.compiler.recordings.taxonomy import Taxonomy, published
from thenar.runtime.toml_source import Place, Source, read_source
from thenar.runtime.toml_struct import as_list, as_table, check_finite, check_keys, convert

from ..body.shapes import Shape
from ..errors import SceneError
from .scene import SceneObject

_SHAPES: dict[str, type[Shape]] = {str(shape.__struct_config__.tag): shape for shape in get_args(Shape)}
_OF_ANY_SHAPE = SceneObject.__struct_encode_fields__


@dataclass(frozen=True, slots=True)
class Catalogue:
    """Objects for a taxonomy, under a name."""

    name: str
    taxonomy: str
    objects: tuple[SceneObject, ...]


class _File(msgspec.Struct, frozen=True):
    taxonomy: str
    objects: list[object]


def load_catalogue(name_or_path: str | Path) -> Catalogue:
    """Read the catalogue that is shipped under a name, or lies in a file. Raises SceneError with file, line and key."""
    file = name_or_path if isinstance(name_or_path, Path) else _shipped(name_or_path)
    source = read_source(file, SceneError)
    tables = source.tables()
    check_finite(source, (), tables)
    found = convert(source, (), tables, _File)
    taxonomy = find_taxonomy(source, found.taxonomy)
    return Catalogue(file.name.removesuffix(".toml"), taxonomy.name, objects_of(source, found.objects, taxonomy))


def find_taxonomy(source: Source, name: str) -> Taxonomy:
    """Return the published taxonomy that `source` names under `taxonomy`; raises SceneError."""
    try:
        return published(name)
    except RecordingError as reason:
        raise source.error(("taxonomy",), str(reason)) from reason


def objects_of(source: Source, tables: object, taxonomy: Taxonomy) -> tuple[SceneObject, ...]:
    """Return the `[[objects]]` of a scene or catalogue; grasp types may be written as anything that `taxonomy` finds.

    Raises SceneError about the first that is wrong, and if a grasp type has none.
    """
    place: Place = ("objects",)
    found = tuple(_object(source, (*place, n), item, taxonomy) for n, item in enumerate(as_list(source, place, tables)))
    check_names(source, place, [item.name for item in found])
    if lacking := [grasp for grasp in taxonomy.types if grasp not in {item.grasp for item in found}]:
        raise source.error(place, f"no object for {list_names(lacking)}: every type of {taxonomy.name} needs one")
    return found


def check_names(source: Source, place: Place, names: list[str]) -> None:
    """Raise SceneError about the first of the tables at `place` whose name is taken or would not survive a file."""
    first: dict[str, int] = {}
    for number, name in enumerate(names):
        if reason := fault(name):
            raise source.error((*place, number, "name"), f"{name!r} {reason}")
        if name in first:
            line = source.line((*place, first[name]))
            raise source.error((*place, number, "name"), f"{name!r} is taken (line {line}): give every one its own")
        first[name] = number


def _object(source: Source, place: Place, value: object, taxonomy: Taxonomy) -> SceneObject:
    table = as_table(source, place, value)
    shape = _shape(source, place, table)
    common = {key: table[key] for key in _OF_ANY_SHAPE if key in table}
    item = convert(source, place, common | {"shape": shape}, SceneObject)
    grasp = taxonomy.find(item.grasp)
    if grasp is None:
        advice = taxonomy.suggestion(item.grasp)
        raise source.error((*place, "grasp"), f"{item.grasp!r} is not a grasp type of {taxonomy.name}{advice}")
    return msgspec.structs.replace(item, grasp=grasp)


def _shape(source: Source, place: Place, table: dict[str, object]) -> Shape:
    name = table.get("shape")
    if not isinstance(name, str) or name not in _SHAPES:
        wrong = f"{name!r} is not a shape" if "shape" in table else "the key shape is missing"
        raise source.error((*place, "shape"), f"{wrong}{nearest(str(name), list(_SHAPES))}")
    kind = _SHAPES[name]
    check_keys(source, place, table, (*_OF_ANY_SHAPE, *kind.__struct_encode_fields__))
    return convert(source, place, {key: table[key] for key in kind.__struct_encode_fields__ if key in table}, kind)


def _catalogues() -> Iterator[Traversable]:
    data = files("thenar.simulator.planning") / "data"
    return (file for file in data.iterdir() if file.name.endswith(".toml"))


def _shipped(name: str) -> Traversable:
    known = {file.name.removesuffix(".toml"): file for file in _catalogues()}
    if name not in known:
        raise SceneError(f"no catalogue of objects is called {name!r}{nearest(name, sorted(known))}")
    return known[name]
