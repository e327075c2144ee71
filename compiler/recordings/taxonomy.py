"""Taxonomies of grasp types: Kamakura's 14, Cutkosky's 16, Feix's 33, and the user's own.

A type is referred to by its name, and in the published taxonomies also by its abbreviation, full name or number; case,
underscores and punctuation are ignored. An `objects.toml` says with which objects each type is collected (the paper
used two of different volume); each key is a grasp type, its value a list of objects:

    PoS = ["bottle", "broom"]
    Tip = ["pin", "bead"]

For "none" it lists movements of the empty hand, instead of MOVEMENTS.
"""

import difflib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from unicodedata import decimal

from thenar.runtime.manifest import Manifest
from thenar.runtime.names import LONGEST_SHOWN, MOST_COMPARED, shortened
from thenar.runtime.published import NONE
from thenar.runtime.recording.session import CollectionTask
from thenar.runtime.toml_source import TomlText, read_source

from . import RecordingError, TableError, check_names

# Kamakura et al. 1980, Patterns of static prehension in normal hands, Am. J. Occup. Ther. 34(7):437-445, with the usual
# abbreviations.
_KAMAKURA = {
    "PoS": "Power grip, standard type",
    "PoH": "Power grip, hook type",
    "PoI": "Power grip, index-extension type",
    "PoE": "Power grip, extension type",
    "PoD": "Power grip, distal type",
    "Lat": "Lateral grip",
    "Tpd": "Tripod grip, standard type",
    "TVI": "Tripod grip, variation I",
    "TVII": "Tripod grip, variation II",
    "PMF": "Parallel mild flexion grip",
    "CMF": "Circular mild flexion grip",
    "Tip": "Tip grip",
    "PE": "Parallel extension grip",
    "Add": "Adduction grip",
}

# Cutkosky 1989, On grasp choice, grasp models, and the design of hands for manufacturing tasks, IEEE T-RA 5(3):269-279.
_CUTKOSKY = (
    "Large diameter; Small diameter; Medium wrap; Adducted thumb; Light tool; Thumb-4 finger; Thumb-3 finger; "
    "Thumb-2 finger; Thumb-index finger; Disk (power); Sphere (power); Disk (precision); Sphere (precision); Tripod; "
    "Hook, platform, push; Lateral pinch"
)

# Feix et al. 2016, The GRASP taxonomy of human grasp types, IEEE T-HMS 46(1).
_FEIX = (
    "Large Diameter; Small Diameter; Medium Wrap; Adducted Thumb; Light Tool; Prismatic 4 Finger; Prismatic 3 Finger; "
    "Prismatic 2 Finger; Palmar Pinch; Power Disk; Power Sphere; Precision Disk; Precision Sphere; Tripod; Fixed Hook; "
    "Lateral; Index Finger Extension; Extension Type; Distal Type; Writing Tripod; Tripod Variation; "
    "Parallel Extension; Adduction Grip; Tip Pinch; Lateral Tripod; Sphere 4 Finger; Quadpod; Sphere 3 Finger; Stick; "
    "Palmar; Ring; Ventral; Inferior Pincer"
)

_PUBLISHED = {
    "kamakura14": tuple(_KAMAKURA),
    "cutkosky16": tuple(_CUTKOSKY.split("; ")),
    "feix33": tuple(_FEIX.split("; ")),
}


@dataclass(frozen=True, slots=True)
class Taxonomy:
    """The grasp types that a set may hold, in order: a type's index is its label.

    `name` is "kamakura14", "cutkosky16", "feix33", or the user's own. "none", meaning that nothing is held, is not a
    type: every taxonomy has it implicitly, with the label after those of the types. A user's own types may still
    include it: then it is a type like any other. Raises RecordingError if two types are equal, a name is empty, or a
    published name is used for other types than the published ones.
    """

    name: str
    types: tuple[str, ...]

    def __post_init__(self) -> None:
        check_names("taxonomy", [self.name])
        check_names("grasp type", self.types)
        published = _PUBLISHED.get(self.name, self.types)
        if self.types != published:
            raise RecordingError(f"taxonomy {self.name} has {len(published)} published types: use another name")

    @property
    def names(self) -> tuple[str, ...]:
        """The meanings of labels: the types, in order, and that nothing is held."""
        return self.types if NONE in self.types else (*self.types, NONE)

    @property
    def full_names(self) -> tuple[str, ...]:
        """The types written out, in the same order."""
        return tuple(_KAMAKURA.values()) if self.name == "kamakura14" else self.types

    def finder(self) -> Callable[[str], str | None]:
        """Return a function from a label to its type, or None; created once for many labels."""
        types, aliases = frozenset(self.names), self._aliases()
        return lambda label: label if label in types else aliases.get(plain(label))

    def find(self, label: str) -> str | None:
        """Return the type of `label`, or None."""
        return self.finder()(label)

    def unknown(self, label: str) -> str:
        """Return the message about an unknown `label`, with the most similar types."""
        return f"{shortened(repr(label))} is not a grasp type of {self.name}{self.suggestion(label)}"

    def suggestion(self, label: str) -> str:
        """Return " (did you mean ...?)" with the most similar types, or the available types if none is similar."""
        aliases = self._aliases()
        # Each comparison takes time proportional to the length of the label times that of the type.
        written, compared = plain(label[:LONGEST_SHOWN]), list(aliases)[:MOST_COMPARED]
        near = {aliases[alias]: None for alias in difflib.get_close_matches(written, compared, n=3)}
        if near:
            return f" (did you mean {' or '.join(map(repr, near))}?)"
        shown = ", ".join(map(shortened, self.types[:5])) + (", ..." if len(self.types) > 5 else "")
        return f" (its types: {shown})"

    def _aliases(self) -> dict[str, str]:
        """Plain spelling -> type; a spelling shared by two types means neither."""
        found: dict[str, str | None] = {}
        for number, (name, full) in enumerate(zip(self.types, self.full_names, strict=True), start=1):
            spellings = {name, full, str(number)} if self.name in _PUBLISHED else {name}
            for written in map(plain, spellings):
                found[written] = None if found.get(written, name) != name else name
        found[NONE] = NONE
        return {written: name for written, name in found.items() if name is not None}


def plain(label: str) -> str:
    """Return `label` without case, blanks, underscores and punctuation: "Sphere_4-Finger" -> "sphere4finger"."""
    words = re.sub(r"[\W_]+", "", label.casefold())
    # Without int(), which takes at most 4,300 digits; digits of other scripts count like ours.
    if words.isdecimal():
        return "".join(str(decimal(digit)) for digit in words).lstrip("0") or "0"
    return words or label


def own(types: Iterable[str]) -> Taxonomy:
    """Return the user's own taxonomy of `types`, in their order."""
    return Taxonomy("own", tuple(types))


def published(name: str) -> Taxonomy:
    """Return the published taxonomy called `name`; raises RecordingError naming the available ones."""
    if name not in _PUBLISHED:
        raise RecordingError(
            f"no taxonomy is called {shortened(repr(name))}: take one of {', '.join(_PUBLISHED)}, own, or a list"
        )
    return Taxonomy(name, _PUBLISHED[name])


def published_for(labels: Iterable[str]) -> str | None:
    """Return the only published taxonomy whose types include all `labels`, None if there is none or several."""
    written = [label for label in labels if not plain(label).isdecimal()]
    fitting = [name for name in _PUBLISHED if written and all(map(published(name).finder(), labels))]
    return fitting[0] if len(fitting) == 1 and written else None


def is_published(taxonomy: Taxonomy) -> bool:
    """Return whether `published(taxonomy.name)` is `taxonomy`."""
    return taxonomy.name in _PUBLISHED


# The object of a grasp type if none is named.
ANY = "any"
# The movements of an empty hand, and the instructions for them.
MOVEMENTS = {
    "open hand": "hold the hand open, flat or relaxed, and touch nothing",
    "approach": "reach for an object and shape the hand for it, without touching it",
    "release": "draw back from an object that was just let go, and open the hand",
    "idle movement": "move the hand as between two tasks: point, turn, wave, touch nothing",
}


def collected(taxonomy: str, objects: Path | None, none: bool = False) -> tuple[Taxonomy, tuple[CollectionTask, ...]]:
    """Return the taxonomy of this name and the tasks to collect: those that `objects` lists, or every type.

    With `none`, movements of the empty hand are included. "own" is the user's own taxonomy: the types that `objects`
    lists, in its order. Raises RecordingError, or TableError naming file, line and key.
    """
    if objects is None:
        types = published(taxonomy)
        return types, (
            *(CollectionTask(grasp, (ANY,)) for grasp in types.types),
            *(CollectionTask(NONE, tuple(MOVEMENTS)),) * none,
        )
    source = read_source(objects, TableError)
    tables = source.tables()
    listed = [key for key in tables if plain(key) == NONE]
    movements = _objects(source, listed[0], tables.pop(listed[0])) if listed else tuple(MOVEMENTS)
    if len(tables) < 2:
        raise TableError(f"{objects.name} names {len(tables)} grasp types: a collection takes two at least")
    types = own(tables) if taxonomy == "own" else published(taxonomy)
    find = types.finder()
    tasks: dict[str, CollectionTask] = {}
    for key, value in tables.items():
        grasp = find(key)
        if grasp is None:
            raise source.error((key,), types.unknown(key))
        if grasp in tasks:
            raise source.error((key,), f"is {grasp}, which is listed already: list it once")
        tasks[grasp] = CollectionTask(grasp, _objects(source, key, value))
    return types, (*tasks.values(), *(CollectionTask(NONE, movements),) * none)


def tasks_of(manifest: Manifest, add_type: Sequence[str] = ()) -> tuple[Taxonomy, tuple[CollectionTask, ...]]:
    """Return the taxonomy of a build, and the tasks to collect for it: its types and those to add, and nothing held if
    it knows it. Raises RecordingError if it knows one to add already.
    """
    name, grasps = manifest.source.taxonomy, manifest.grasps_with(add_type)
    held = tuple(grasp for grasp in manifest.grasps if grasp != NONE) + tuple(add_type)
    check_names("grasp type", (NONE, *held))
    types = published(name) if name in _PUBLISHED else Taxonomy(name, held)
    types = types if {*held} <= {*types.types} else own(held)
    tasks = (CollectionTask(grasp, tuple(MOVEMENTS) if grasp == NONE else (ANY,)) for grasp in grasps)
    return types, tuple(tasks)


def _objects(source: TomlText, key: str, value: object) -> tuple[str, ...]:
    try:
        if not isinstance(value, list) or not value or not all(isinstance(name, str) for name in value):
            raise RecordingError("must be a list of the names of objects, at least one")
        check_names("object", value)
        return tuple(value)
    except RecordingError as wrong:
        raise source.error((key,), str(wrong)) from None
