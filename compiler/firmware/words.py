"""Names of a build in generated code: as C identifiers, comments and string literals, whatever characters they have."""

import hashlib
import re
import unicodedata
from collections.abc import Sequence
from functools import lru_cache
from importlib.metadata import version

from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Origin, Proof, Switch
from thenar.runtime.model.integers import IntegerTables, tables_to_bytes
from thenar.runtime.published import NONE
from thenar.runtime.recipe import Recipe

from . import FirmwareError

_LONGEST_NAME = 32


def answers_of(names: Manifest) -> tuple[str, ...]:
    """Return the possible results for a frame: the grasp types, and "none" if it is not one of them but a frame can be
    rejected, or a segment can be of no type.
    """
    segments = names.segments is not None and names.segments.refusal is not None
    return (*names.grasps, NONE) if names.rejection is not None or segments else names.grasps


def none_of(names: Manifest) -> int | None:
    """Return the number of "none" among the possible results for a frame; None if it is not one of them."""
    return len(found) - 1 if (found := answers_of(names))[-1] == NONE else None


@lru_cache(maxsize=4)
def numbered(tables: IntegerTables) -> Manifest:
    """Return a manifest for tables without a build, in which names are numbers: "type 0", "s0", "j0" and so on."""
    return Manifest(
        schema=SCHEMA,
        checksum="",
        thenar=version("thenar"),
        tables_sha256=hashlib.sha256(tables_to_bytes(tables)).hexdigest(),
        ensemble_sha256="",
        source=Origin("", 0, "", tables.n_switches, joints=tables.n_joints),
        options=Recipe(),
        grasps=tuple(f"type {number}" for number in range(tables.n_classes)),
        switches=tuple(Switch(number, f"s{number}", 0.0) for number in range(tables.n_switches)),
        joints=tuple(Calibration(number, f"j{number}", "raw", 0, 0.0, 1, 1.0) for number in range(tables.n_joints)),
        proof=Proof(16, tables.scale, tables.bound, 0.0, 0.0, 0, 0),
        rates=(),
    )


def check_name(name: str) -> None:
    """Raise FirmwareError unless `name` is valid in names of C files and functions: thenar_NAME."""
    if not re.fullmatch(rf"[a-z][a-z0-9_]{{0,{_LONGEST_NAME - 1}}}", name):
        raise FirmwareError(
            f"{name!r} cannot be the name: use lower-case letters a to z, digits and _, a letter first, "
            f"at most {_LONGEST_NAME} characters"
        )


def identifiers(texts: Sequence[str]) -> list[str]:
    """Return for each text a unique suffix for C identifiers, in capitals: "index tip" is INDEX_TIP."""
    found: dict[str, None] = {}
    for number, text in enumerate(texts):
        plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().upper()
        word = shown = re.sub(r"[^A-Z0-9]+", "_", plain).strip("_") or str(number)
        while word in found:
            word = f"{shown}_{number}" if word == shown else f"{word}_"
        found[word] = None
    return list(found)


def inputs_in_words(switches: int, joints: int) -> str:
    """Return the numbers of inputs in words, without zeros: "31 switches and 1 joint"."""
    counts = ((switches, "switch", "switches"), (joints, "joint", "joints"))
    return " and ".join(f"{count} {one if count == 1 else more}" for count, one, more in counts if count)


def joint_in_words(joint: Calibration) -> str:
    """Return a joint and the meaning of its codes: "thumb: code 0 = 0 deg, 255 = 90 deg"."""
    if joint.unit == "raw":
        return f"{joint.name}: the glove's own codes"
    first, last = ((joint.code_a, joint.value_a), (joint.code_b, joint.value_b))
    return f"{joint.name}: code {first[0]} = {first[1]:g} {joint.unit}, {last[0]} = {last[1]:g} {joint.unit}"


def comment(text: str) -> str:
    """Return `text` in one line of ASCII that is safe inside a C comment: it neither ends nor opens one."""
    escaped = "".join(char if " " <= char <= "~" else _escape(char) for char in text)
    # A backslash at the end of a line, or the trigraph for one, would continue a // comment.
    return escaped.replace("*/", "* /").replace("/*", "/ *").replace("??/", "? ?/")


def markdown(text: str) -> str:
    """Return `text` in one line of ASCII that Markdown shows literally."""
    return re.sub(r"([\\`*_{}\[\]<>()#!|&~])", r"\\\1", comment(text))


def string(text: str) -> str:
    """Return the C literal of `text` in UTF-8."""
    return '"' + "".join(_in_literal(byte) for byte in text.encode()) + '"'


def _escape(char: str) -> str:
    code = ord(char)
    return f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}" if code < 65536 else f"\\U{code:08x}"


def _in_literal(byte: int) -> str:
    if 32 <= byte < 127 and chr(byte) not in '"\\?':
        return chr(byte)
    return f"\\{byte:03o}"
