"""A `GraspSet` as a table for other programs, and the columns.toml that reads it back."""

import csv
import glob
import gzip
import io
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from thenar.runtime.files import write_atomically

from ..text import cell
from .errors import TableError
from .graspset import GraspSet, Joint
from .taxonomy import is_published


class Heads(NamedTuple):
    """What the columns that are no inputs are called in an exported table."""

    label: str
    subject: str
    object: str
    trial: str


def heads_of(grasp_set: GraspSet) -> Heads:
    """Return "grasp", "subject", "object", "trial", with an underline where an input has that name."""
    taken = {*grasp_set.switch_names, *grasp_set.joint_names}
    return Heads(*(_free(name, taken) for name in ("grasp", "subject", "object", "trial")))


def columns_of(grasp_set: GraspSet, codes: bool = False, meta: bool = True) -> str:
    """Return the text of a columns.toml for the set's exported table; `codes` and `meta` as in `export`.

    Reading the table with it gives the set again (a taxonomy of the user's own is called "own" then).
    """
    heads = heads_of(grasp_set)
    lines = [f"label = {_text(heads.label)}"]
    if meta:
        lines += [f"{key} = {_text(name)}" for key, name in list(heads._asdict().items())[1:]]
    taxonomy = grasp_set.taxonomy
    lines.append(f"taxonomy = {_text(taxonomy.name) if is_published(taxonomy) else _list(taxonomy.types)}")
    if grasp_set.switch_names:
        lines.append(f"switches = {_globs(grasp_set.switch_names)}")
    for joints in _alike(grasp_set.joints):
        lines += ["", *_entry(joints, codes)]
    return "\n".join([*lines, ""])


def _entry(joints: list[Joint], codes: bool) -> list[str]:
    """Return the [[joints]] entry of joints that are calibrated alike."""
    joint = joints[0]
    points = {key: getattr(joint, key) for key in ("code_a", "value_a", "code_b", "value_b")}
    calibration = ", ".join(f"{key} = {number!r}" for key, number in points.items())
    return [
        "[[joints]]",
        f"columns = {_globs(joint.name for joint in joints)}",
        f"unit = {_text(joint.unit)}",
        *(["codes = true"] if codes else []),
        f"calibration = {{ {calibration} }}",
    ]


def _alike(joints: Iterable[Joint]) -> Iterable[list[Joint]]:
    """Group neighbours of one calibration; the order of the joints is the order of the codes, so only neighbours."""
    return (list(group) for _, group in groupby(joints, key=lambda joint: replace(joint, name="any")))


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    return name


def _text(text: str) -> str:
    # JSON's escapes are TOML's.
    return json.dumps(text, ensure_ascii=False)


def _list(texts: Iterable[str]) -> str:
    return f"[{', '.join(map(_text, texts))}]"


def _globs(names: Iterable[str]) -> str:
    return _list(map(glob.escape, names))


# What Weka reads without quotes; everything else it writes in quotes itself.
_BARE = re.compile(r"[A-Za-z0-9_.+-]+")


def export(
    grasp_set: GraspSet, path: Path, codes: bool = False, meta: bool = False, columns: Path | None = None
) -> None:
    """Write `grasp_set` as .csv, .csv.gz or .arff, whole or not at all; joints as values, or as `codes`.

    An ARFF holds subject, object and trial only with `meta`. To `columns` goes the columns.toml that imports the table
    again. Raises TableError for any other suffix.
    """
    name = path.name.lower()
    if name.endswith(".arff"):
        write_atomically(path, to_arff(grasp_set, codes, meta).encode())
    elif name.endswith(".csv"):
        write_atomically(path, to_csv(grasp_set, codes).encode())
    elif name.endswith(".csv.gz"):
        write_atomically(path, gzip.compress(to_csv(grasp_set, codes).encode(), mtime=0))
    else:
        raise TableError(f"{path.name}: an exported table ends in .csv, .csv.gz or .arff")
    if columns is not None:
        write_atomically(columns, columns_of(grasp_set, codes, meta or not name.endswith(".arff")).encode())


def to_csv(grasp_set: GraspSet, codes: bool = False) -> str:
    """Return grasp type, subject, object, trial, switches and joints as CSV with one header row.

    A name that a spreadsheet would take for a formula has an apostrophe before it, which importing takes away.
    """
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(map(cell, (*heads_of(grasp_set), *grasp_set.switch_names, *grasp_set.joint_names)))
    subjects, objects, trials = _meta(grasp_set)
    grasps, subjects, objects = (list(map(cell, names)) for names in (grasp_set.grasps.tolist(), subjects, objects))
    writer.writerows(zip(grasps, subjects, objects, trials, *_inputs(grasp_set, codes), strict=True))
    return file.getvalue()


def to_arff(grasp_set: GraspSet, codes: bool = False, meta: bool = False) -> str:
    """Return the set as ARFF: switches nominal {0,1}, joints numeric, the grasp type nominal and last."""
    heads = heads_of(grasp_set)
    attributes = _meta_attributes(grasp_set, heads) if meta else []
    attributes += [f"{_quote(name)} {{0,1}}" for name in grasp_set.switch_names]
    attributes += [f"{_quote(name)} numeric" for name in grasp_set.joint_names]
    attributes.append(f"{_quote(heads.label)} {_nominal(grasp_set.taxonomy.types)}")
    subjects, objects, trials = _meta(grasp_set)
    first = (map(_quote, subjects), map(_quote, objects), trials) if meta else ()
    rows = zip(*first, *_inputs(grasp_set, codes), map(_quote, grasp_set.grasps.tolist()), strict=True)
    lines = ["@relation grasps", "", *(f"@attribute {attribute}" for attribute in attributes), "", "@data"]
    return "\n".join([*lines, *map(",".join, rows), ""])


def _meta(grasp_set: GraspSet) -> tuple[list[str], list[str], list[str]]:
    return grasp_set.subjects.tolist(), grasp_set.objects.tolist(), grasp_set.trials.astype(str).tolist()


def _meta_attributes(grasp_set: GraspSet, heads: Heads) -> list[str]:
    subjects, objects = (sorted(set(names)) for names in _meta(grasp_set)[:2])
    return [
        f"{_quote(heads.subject)} {_nominal(subjects)}",
        f"{_quote(heads.object)} {_nominal(objects)}",
        f"{_quote(heads.trial)} numeric",
    ]


def _inputs(grasp_set: GraspSet, codes: bool) -> Iterable[Sequence[str]]:
    """Yield the cells of each switch and each joint."""
    for switch in grasp_set.switches.T:
        yield ["1" if bit else "0" for bit in switch.tolist()]
    for joint, column in zip(grasp_set.joints, grasp_set.codes.T, strict=True):
        yield [str(code) for code in column.tolist()] if codes else _values(joint, column.tolist())


def _values(joint: Joint, codes: list[int]) -> list[str]:
    # Twelve digits tell any two codes of a Joint apart, and hide the last bits of the arithmetic.
    return [f"{value:.12g}" for value in joint.value(codes).tolist()]


def _nominal(names: Iterable[str]) -> str:
    return "{" + ",".join(map(_quote, names)) + "}"


def _quote(name: str) -> str:
    """Return `name` as ARFF writes it: quoted as Weka quotes, when it must be."""
    return name if _BARE.fullmatch(name) else "'" + re.sub(r"([\\'\"%])", r"\\\1", name) + "'"
