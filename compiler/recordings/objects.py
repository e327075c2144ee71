"""`objects.toml`: which objects each grasp type is collected with; a key a grasp type, its value a list of objects.

    PoS = ["bottle", "broom"]
    Tip = ["pin", "bead"]

The paper gave each type two objects of different volume.
"""

from pathlib import Path

from thenar.runtime.recording.session import Task
from thenar.runtime.toml_source import TomlText, read_source

from .errors import ColumnsError, RecordingError, check_names
from .taxonomy import Taxonomy, own, published

# What a grasp type is collected with where no object is named.
ANY = "any"


def collected(taxonomy: str, objects: Path | None) -> tuple[Taxonomy, tuple[Task, ...]]:
    """Return the taxonomy of this name and what is to be collected of it: what `objects` lists, or every type.

    "own" is the user's own taxonomy: the types that `objects` lists, in its order. Raises RecordingError, or
    ColumnsError naming file, line and key.
    """
    if objects is None:
        types = published(taxonomy)
        return types, tuple(Task(grasp, (ANY,)) for grasp in types.types)
    source = read_source(objects, ColumnsError)
    tables = source.tables()
    if len(tables) < 2:
        raise ColumnsError(f"{objects.name} names {len(tables)} grasp types: a collection takes two at least")
    types = own(tables) if taxonomy == "own" else published(taxonomy)
    find = types.finder()
    tasks: dict[str, Task] = {}
    for key, value in tables.items():
        grasp = find(key)
        if grasp is None:
            raise source.error((key,), types.unknown(key))
        if grasp in tasks:
            raise source.error((key,), f"is {grasp}, which is there already: list it once")
        tasks[grasp] = Task(grasp, _objects(source, key, value))
    return types, tuple(tasks.values())


def _objects(source: TomlText, key: str, value: object) -> tuple[str, ...]:
    try:
        if not isinstance(value, list) or not value or not all(isinstance(name, str) for name in value):
            raise RecordingError("must be a list of the names of objects, at least one")
        check_names("object", value)
        return tuple(value)
    except RecordingError as wrong:
        raise source.error((key,), str(wrong)) from None
