"""From a scene's TOML file to a Scene; errors name file, line, key, and a remedy."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, get_args

import msgspec

from thenar.compiler.recordings import RecordingError
from thenar.compiler.recordings.taxonomy import Taxonomy, published
from thenar.runtime.names import fault, list_names, nearest
from thenar.runtime.toml_source import Place, TomlText, read_source
from thenar.runtime.toml_struct import as_list, as_table, check_keys, convert

from ..body.shapes import Shape
from ..errors import SceneError, ThenarError
from ..scenes import shipped
from ..scenes.scene import (
    ListedEffect,
    Recording,
    Scene,
    SceneGlove,
    SceneObject,
    Subject,
    SurveyPopulation,
    draw_subjects,
)
from .effect import EFFECTS, Effect

_SHAPES: dict[str, type[Shape]] = {str(shape.__struct_config__.tag): shape for shape in get_args(Shape)}
_OF_ANY_SHAPE = SceneObject.__struct_encode_fields__


class _CatalogueFile(msgspec.Struct, frozen=True):
    taxonomy: str
    objects: list[object]


def load_catalogue(name_or_path: str | Path) -> tuple[Taxonomy, tuple[SceneObject, ...]]:
    """Return the taxonomy and the objects of a shipped catalogue, by name, or of a file.

    Raises SceneError with file, line and key.
    """
    file = name_or_path if isinstance(name_or_path, Path) else _shipped(name_or_path)
    source = read_source(file, SceneError)
    catalogue = convert(source, (), source.tables(), _CatalogueFile)
    taxonomy = find_taxonomy(source, catalogue.taxonomy)
    return taxonomy, objects_of(source, catalogue.objects, taxonomy)


def find_taxonomy(source: TomlText, name: str) -> Taxonomy:
    """Return the published taxonomy that `source` names under `taxonomy`; raises SceneError."""
    try:
        return published(name)
    except RecordingError as reason:
        raise source.error(("taxonomy",), str(reason)) from reason


def objects_of(source: TomlText, tables: object, taxonomy: Taxonomy) -> tuple[SceneObject, ...]:
    """Return the `[[objects]]` of a scene or catalogue; grasp types may be written in any form that `taxonomy` finds.

    Raises SceneError for the first that is wrong, or if a grasp type has none.
    """
    place: Place = ("objects",)
    listed = enumerate(as_list(source, place, tables))
    objects = tuple(_object(source, (*place, number), item, taxonomy) for number, item in listed)
    check_names(source, place, [item.name for item in objects])
    if lacking := [grasp for grasp in taxonomy.types if grasp not in {item.grasp for item in objects}]:
        raise source.error(place, f"no object for {list_names(lacking)}: every type of {taxonomy.name} needs one")
    return objects


def check_names(source: TomlText, place: Place, names: list[str]) -> None:
    """Raise SceneError for the first of the tables at `place` whose name is taken or would not survive a file."""
    first: dict[str, int] = {}
    for number, name in enumerate(names):
        if reason := fault(name):
            raise source.error((*place, number, "name"), f"{name!r} {reason}")
        if name in first:
            line = source.line((*place, first[name]))
            raise source.error((*place, number, "name"), f"{name!r} is taken (line {line}): give each a unique name")
        first[name] = number


def _object(source: TomlText, place: Place, value: object, taxonomy: Taxonomy) -> SceneObject:
    table = as_table(source, place, value)
    shape = _shape(source, place, table)
    common = {key: table[key] for key in _OF_ANY_SHAPE if key in table}
    item = convert(source, place, common | {"shape": shape}, SceneObject)
    grasp = taxonomy.find(item.grasp)
    if grasp is None:
        advice = taxonomy.suggestion(item.grasp)
        raise source.error((*place, "grasp"), f"{item.grasp!r} is not a grasp type of {taxonomy.name}{advice}")
    return msgspec.structs.replace(item, grasp=grasp)


def _shape(source: TomlText, place: Place, table: dict[str, object]) -> Shape:
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


class _SceneFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A scene's file: tables are decoded one by one."""

    name: str | None = None
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
    taxonomy: str
    objects: object
    repetitions: Annotated[int, msgspec.Meta(ge=1, le=100_000)]
    recording: object = {}
    glove: object = {}
    subjects: object = None
    population: object = None
    effects: object = {}


def shipped_scenes() -> dict[str, str]:
    """Return the shipped scenes by name, each with the first comment in its file."""
    return {name: file.read_text().partition("\n")[0].removeprefix("# ") for name, file in shipped().items()}


def load_scene(name_or_path: str | Path) -> Scene:
    """Return a shipped scene by name, or one from a TOML file: a path has a suffix or a folder.

    Raises SceneError with file, line and key.
    """
    path = Path(name_or_path)
    source = read_source(_file(path), SceneError)
    return _Decoder(source, convert(source, (), source.tables(), _SceneFile)).scene(path.stem)


def located(name_or_path: str | Path, fault: SceneError) -> ThenarError:
    """Return an error about a key of a scene with file and line added, if it names a key but no location.

    Such errors come from the combination of effects; any other error is returned unchanged.
    """
    key, _, reason = str(fault).partition(": ")
    if not re.fullmatch(r"(effects|recording)(\.\w+)+", key):
        return fault
    return read_source(_file(Path(name_or_path)), SceneError).error(tuple(key.split(".")), reason)


def own_file(name_or_path: str | Path) -> Path | None:
    """Return the user's own scene file; None for the name of a shipped scene."""
    path = Path(name_or_path)
    return path if path.suffix or len(path.parts) > 1 else None


def _file(path: Path) -> Traversable:
    known = shipped()
    if own_file(path):
        if not path.exists():
            raise SceneError(f"there is no file {path}; shipped scenes have the names {', '.join(known)}")
        return path
    if path.name not in known:
        advice = "; the path of your own scene file ends in .toml"
        raise SceneError(f"no shipped scene is called {path.name!r}{nearest(path.name, list(known))}{advice}")
    return known[path.name]


@dataclass(frozen=True, slots=True)
class _Decoder:
    """A scene being decoded."""

    source: TomlText
    file: _SceneFile

    def scene(self, default_name: str) -> Scene:
        """Return the whole scene."""
        source, file = self.source, self.file
        name = default_name if file.name is None else file.name
        if reason := fault(name):
            raise source.error(("name",), f"{name!r} {reason}")
        taxonomy = find_taxonomy(source, file.taxonomy)
        return Scene(
            name=name,
            seed=file.seed,
            taxonomy=taxonomy.name,
            objects=self._objects(taxonomy),
            subjects=self._subjects(),
            repetitions=file.repetitions,
            recording=convert(source, ("recording",), file.recording, Recording),
            glove=convert(source, ("glove",), file.glove, SceneGlove),
            effects=self._effects(),
        )

    def _objects(self, taxonomy: Taxonomy) -> tuple[SceneObject, ...]:
        name = self.file.objects
        if not isinstance(name, str):
            return objects_of(self.source, name, taxonomy)
        try:
            of, objects = load_catalogue(name)
        except SceneError as reason:
            raise self.source.error(("objects",), str(reason)) from reason
        if of.name != taxonomy.name:
            fits = f"catalogue {name!r} is for taxonomy {of.name!r}, not {taxonomy.name!r}"
            raise self.source.error(("objects",), fits)
        return objects

    def _subjects(self) -> tuple[Subject, ...]:
        source, listed, population = self.source, self.file.subjects, self.file.population
        if (listed is None) == (population is None):
            reason = (
                "is missing, and there are no [[subjects]]" if listed is None else "and [[subjects]] are both there"
            )
            raise source.error(("population",), f"{reason}: write one of the two")
        if population is not None:
            return draw_subjects(convert(source, ("population",), population, SurveyPopulation), self.file.seed)
        tables = enumerate(as_list(source, ("subjects",), listed))
        subjects = tuple(convert(source, ("subjects", number), table, Subject) for number, table in tables)
        check_names(source, ("subjects",), [subject.name for subject in subjects])
        return subjects

    def _effects(self) -> tuple[ListedEffect, ...]:
        tables = dict(self._effect_tables())
        effects = sorted((EFFECTS[name] for name in tables), key=lambda effect: (effect.order, effect.name))
        return tuple(self._listed(effect, tables[effect.name]) for effect in effects)

    def _listed(self, effect: Effect, table: object) -> ListedEffect:
        place = ("effects", *effect.name.split("."))
        parameters = convert(self.source, place, table, effect.parameters())
        if sum(getattr(parameters, name) is not None for name in effect.either) > 1:
            raise self.source.error(place, f"give {' or '.join(f'`{name}`' for name in effect.either)}, not both")
        return ListedEffect(effect.name, tuple(msgspec.structs.asdict(parameters).items()))

    def _effect_tables(self) -> Iterator[tuple[str, object]]:
        for group, value in as_table(self.source, ("effects",), self.file.effects).items():
            members = as_table(self.source, ("effects", group), value)
            if not members or not all(isinstance(member, dict) for member in members.values()):
                self._check_effect(group, ("effects", group))
            for name, table in members.items():
                self._check_effect(f"{group}.{name}", ("effects", group, name))
                yield f"{group}.{name}", table

    def _check_effect(self, name: str, place: tuple[str, ...]) -> None:
        if name not in EFFECTS:
            raise self.source.error(place, f"there is no effect {name!r}{nearest(name, tuple(EFFECTS))}")
        if len(place) != 3:
            raise self.source.error(place, f"write the name without quotes: [effects.{name}]")
