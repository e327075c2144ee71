"""The choices of a recipe, one a field, as the options of the commands and the table in the reference describe them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from msgspec import Meta

from thenar.runtime.recipe import Part, Recipe


@dataclass(frozen=True, slots=True)
class Choice:
    """A field of `Recipe`.

    Attributes
    ----------
    name : str
        The field.
    option : str
        Its name on the command line, with underscores.
    part : {"placement", "limits", "training", "tables", "rates"}
        What it changes; what comes after that is made again too.
    help : str
        One sentence for users.
    kind : type
        bool, int, float, str, tuple (of names) or dict.
    names : tuple
        The valid values, where there are a few.
    least, most : float or None
        The range of a number; `open`: the least itself is not in it.
    default : object
        The default value; `usual` says in words what None means.
    metavar, unit : str
        What stands for the value in help, and a word that follows it on the command line.
    """

    name: str
    option: str
    part: Part
    help: str
    kind: type
    default: Any
    names: tuple[Any, ...] = ()
    least: float | None = None
    most: float | None = None
    open: bool = False
    usual: str = ""
    metavar: str | None = None
    unit: str = ""


def choices() -> Mapping[str, Choice]:
    """Return all choices by the name of the field, in the order of `Recipe`."""
    hints, defaults = get_type_hints(Recipe, include_extras=True), Recipe()
    return {name: _choice_of(name, hint, getattr(defaults, name)) for name, hint in hints.items()}


def _choice_of(name: str, hint: Any, default: Any) -> Choice:
    metas = list(_metas(hint))
    (about,) = (meta for meta in metas if meta.extra)
    more: dict[str, Any] = dict(about.extra or {})
    # Of several types, the outermost is first.
    range_of = next((meta for meta in metas if meta is not about), Meta())
    kind, names = _kind(hint)
    most = more.get("most", range_of.le)
    return Choice(
        name=name,
        option=more.get("option", name),
        part=more["part"],
        help=about.description or "",
        kind=kind,
        default=default,
        names=names,
        least=more.get("least", range_of.ge if range_of.gt is None else range_of.gt),
        most=None if most is None or most >= _NO_LIMIT else most,
        open=range_of.gt is not None,
        usual=more.get("default", ""),
        metavar=more.get("metavar"),
        unit=more.get("unit", ""),
    )


# Larger limits only keep a file sound; nobody reaches them.
_NO_LIMIT = 1e6


def _metas(hint: Any) -> Iterator[Meta]:
    """Yield what is said of a type, and of the types that it is made of."""
    yield from (each for each in getattr(hint, "__metadata__", ()) if isinstance(each, Meta))
    yield from (meta for part in get_args(hint) if not isinstance(part, Meta) for meta in _metas(part))


def _kind(hint: Any) -> tuple[type, tuple[Any, ...]]:
    """Return the kind of a type's values, and these if there are a few."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Literal:
        return type(parts[0]), parts
    if origin is None:
        return hint, ()
    if origin in (tuple, dict):
        return origin, ()
    return _kind(next(part for part in parts if part is not type(None)))
