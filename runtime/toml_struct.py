"""Tables of a TOML file as msgspec structs; errors use TOML's terms and say what to write instead.

All errors raised here are those of the source that is read.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TypeVar

import msgspec
from msgspec import inspect

from .errors import ThenarError
from .names import fault, list_names, nearest, shortened
from .toml_source import Place, TomlText, spelled

S = TypeVar("S", bound=msgspec.Struct)
# Its place in a file, and what is wrong.
Fault = tuple[Place, str]

_TYPES = {"float": "a number", "int": "a whole number", "str": "text", "bool": "true or false", "array": "a list"}
_TYPES |= {"object": "a table"}
# msgspec's names for the types of TOML values.
_KINDS = {float: "float", int: "int", str: "str", bool: "bool", list: "array", dict: "object"}
_BOUNDS = {">=": "at least", "<=": "at most", ">": "above", "<": "below"}


def convert(source: TomlText, place: Place, table: object, kind: type[S]) -> S:
    """Return `table`, found at `place` in `source`, as a struct. Raises the error of the first wrong key."""
    keys = as_table(source, place, table)
    if kind.__struct_config__.forbid_unknown_fields:
        check_keys(source, place, keys, kind.__struct_encode_fields__)
    try:
        return msgspec.convert(keys, kind)
    except msgspec.ValidationError as reason:
        raise _worded(source, place, keys, kind, str(reason)) from reason


def as_table(source: TomlText, place: Place, value: object) -> dict[str, object]:
    """Return `value` if it is a table; raises otherwise."""
    if isinstance(value, dict):
        return value
    raise source.error(place, f"must be a table, not {_shown(value)}")


def as_list(source: TomlText, place: Place, value: object) -> list[object]:
    """Return `value` if it is a list that holds something; raises otherwise."""
    if isinstance(value, list) and value:
        return value
    raise source.error(place, f"must be a list of tables, not {_shown(value)}")


def check_keys(source: TomlText, place: Place, table: Mapping[str, object], known: Collection[str]) -> None:
    """Raise the error of the first key of `table` that is not `known`."""
    for key in table:
        if key not in known:
            raise source.error((*place, key), _advice(key, known))


def wrong_names(named: Iterable[tuple[Place, str]], what: str) -> Iterator[Fault]:
    """Yield names of a `what` that are invalid or used twice."""
    all_named = list(named)
    for place, name in all_named:
        if reason := fault(name):
            yield place, f"{shortened(repr(name))} is not a valid name of a {what}: it {reason}"
    yield from used_twice(((place, f"{what} {name!r}") for place, name in all_named), "use the name in one place")


def used_twice(named: Iterable[tuple[Place, str]], advice: str) -> Iterator[Fault]:
    """Yield what is named a second time, with its first place."""
    seen: dict[str, Place] = {}
    for place, name in named:
        if name in seen:
            yield place, f"{name} is already {spelled(seen[name])}: {advice}"
        seen[name] = place


def _advice(key: str, known: Collection[str]) -> str:
    """Return advice for an unknown key."""
    return f"this key is unknown{nearest(key, sorted(known))}"


def _worded(source: TomlText, place: Place, table: dict[str, object], kind: type[S], reason: str) -> ThenarError:
    """Return msgspec's complaint about `table` as an error that names the key."""
    sentence, _, path = reason.partition(" - at `$")
    inner, value = _followed(path, table, sentence)
    if found := re.fullmatch(r"Object contains unknown field `(.+)`", sentence):
        known = [
            field.encode_name for member in _members(_type_at(kind, inner)) for field in getattr(member, "fields", ())
        ]
        return source.error((*place, *inner, found[1]), _advice(found[1], known))
    return source.error((*place, *inner), _sentence(sentence, value, kind, inner))


def _followed(path: str, table: object, sentence: str) -> tuple[Place, object]:
    """Return the place and the value that a path of msgspec leads to; it does not say which key of a dict it means."""
    inner: Place = ()
    value = table
    for name, number in re.findall(r"\.(\w+)|\[(\d+|\.{3})\]", path):
        key = name or (_first_of(value, sentence) if number == "..." else int(number))
        inner, value = (*inner, key), value[key]  # type: ignore[index]
    return inner, value


def _first_of(table: object, sentence: str) -> str:
    """Return the key of the first value in `table` of the kind that msgspec says it got."""
    got = sentence.partition(", got ")[2].strip("`")
    pairs: list[tuple[str, object]] = list(table.items()) if isinstance(table, dict) else []
    return next((key for key, value in pairs if _KINDS.get(type(value)) == got), pairs[0][0])


def _sentence(reason: str, value: object, kind: type[S], inner: Place) -> str:
    if found := re.fullmatch(r"Object missing required field `(.+)`", reason):
        return f"the key {found[1]} is missing"
    if found := re.fullmatch(r"Expected `(.+)`, got `.+`", reason):
        # TOML has no null: optional values are left out.
        wanted = " or ".join(_TYPES.get(name, name) for name in found[1].split(" | ") if name != "null")
        return f"must be {wanted}, not {_shown(value)}"
    if found := re.fullmatch(r"Expected `.+` ([<>]=?) (.+)", reason):
        bound = found[2] if found[2].lstrip("-").isdigit() else f"{float(found[2]):.15g}"
        return f"must be {_BOUNDS[found[1]]} {bound}, not {_shown(value)}"
    if reason.startswith("Invalid enum value"):
        choices = [
            str(choice) for member in _members(_type_at(kind, inner)) for choice in getattr(member, "values", ())
        ]
        near = nearest(value, choices) if isinstance(value, str) else f" (there are: {list_names(choices)})"
        return f"{_shown(value)} is not among its values{near}"
    if found := re.fullmatch(r"Expected `(.+)` of (length .+)", reason):
        return f"must be {_TYPES.get(found[1], found[1])} of {found[2]}"
    return reason.replace("Number", "is a number")


def _type_at(kind: type[S], inner: Place) -> inspect.Type:
    """Return the type required at `inner` of a table that becomes a `kind`."""
    found = inspect.type_info(kind)
    for key in inner:
        for member in _members(found):
            if isinstance(member, inspect.StructType):
                found = next(field.type for field in member.fields if field.encode_name == key)
            elif isinstance(member, inspect.VarTupleType):
                found = member.item_type
            elif isinstance(member, inspect.DictType):
                found = member.value_type
    return found


def _members(allowed: inspect.Type) -> tuple[inspect.Type, ...]:
    """Return the types that a value may have."""
    return allowed.types if isinstance(allowed, inspect.UnionType) else (allowed,)


def _shown(value: object) -> str:
    """Return a value as written in TOML, or its kind if that would be long."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return "a list" if value else "an empty list"
    if isinstance(value, bool):
        return str(value).lower()
    return shortened(repr(value) if isinstance(value, str) else str(value))
