"""A `GraspSet` as a table that other programs open: CSV, and ARFF for Weka 3.6."""

import csv
import gzip
import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from thenar.runtime.files import write_atomically

from .columns_of import Heads, heads_of
from .errors import TableError
from .graspset import GraspSet, Joint
from .spreadsheet import cell

# What Weka reads without quotes; everything else it writes in quotes itself.
_BARE = re.compile(r"[A-Za-z0-9_.+-]+")


def export(grasp_set: GraspSet, path: Path, codes: bool = False, meta: bool = False) -> None:
    """Write `grasp_set` as .csv, .csv.gz or .arff, whole or not at all; joints as values, or as `codes`.

    An ARFF holds subject, object and trial only with `meta`. Raises TableError for any other suffix.
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
