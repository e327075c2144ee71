"""The JSON documents of a build: canonical bytes, read within a limit and of one schema."""

from typing import TypeVar

import msgspec
from msgspec import Struct

from .errors import BuildError

_T = TypeVar("_T")


class _SchemaVersion(Struct, frozen=True):
    """The first part read from a JSON file: whether the rest can be understood."""

    schema: int


def decode_document(data: bytes, kind: type[_T], what: str, called: str, largest: int, schema: int) -> _T:
    """Return a JSON document of a build, whose name in messages is `what`, and whose kind is `called`.

    Raises BuildError if it has more than `largest` bytes, is no such document, or of another schema than `schema`.
    """
    if len(data) > largest:
        raise BuildError(f"{what} has {len(data)} bytes, {called} has at most {largest}")
    try:
        found = msgspec.json.decode(data, type=_SchemaVersion).schema
        if found == schema:
            return msgspec.json.decode(data, type=kind)
    except (ValueError, RecursionError) as wrong:
        raise BuildError(f"{what} is not a build's: {wrong}") from None
    raise BuildError(f"{what} has schema {found}, this thenar reads {schema}: compile the build again with this one")


def encode_document(document: Struct) -> bytes:
    """Return the canonical bytes of a JSON document of a build: indented by two, one newline at the end."""
    return msgspec.json.format(msgspec.json.encode(document), indent=2) + b"\n"
