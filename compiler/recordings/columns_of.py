"""The columns.toml that reads an exported table back into the set it came from."""

import glob
import json
from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby
from typing import NamedTuple

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
