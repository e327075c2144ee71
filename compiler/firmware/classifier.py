"""The classifier of a build as C99 for every target, and as assembly for an AVR."""

from collections.abc import Sequence
from importlib.metadata import version

from thenar.firmware_templates.rendering import render
from thenar.runtime.manifest import Calibration, Manifest

from .assembly import assembly_values, check_size
from .layout import Layout
from .lookups import Lookup, lookups
from .parts import Parts, parts_of
from .portable import avr_macros, portable_values
from .row_text import number_lines, remark, table_lines
from .words import comment, inputs_in_words, string

_FOLDER = "classifier/"


def classifier_files(
    name: str, manifest: Manifest, layout: Layout, *, avr: bool, notes: Sequence[str] = ()
) -> dict[str, str]:
    """Return the texts of thenar_`name`.h and .c, and with `avr` of thenar_`name`_avr.S.

    `name` is one that words.check_name allows, `manifest` that of the build whose tables `layout` arranges. With
    `avr` the .c serves AVRs, where the .S adds, and all others; without it, all but AVRs. `notes` are lines for the
    opening comments. Raises FirmwareError if the tables are beyond what an AVR can read.
    """
    if avr:
        check_size(layout)
    parts = parts_of(layout.tables.n_classes)
    common = _common_values(name, manifest, layout, parts, avr)
    texts: dict[str, dict[str, object]] = {
        ".h": {"groups": _group_notes(manifest, layout), "joints": _joint_notes(manifest)},
        ".c": _source_values(manifest, layout, parts) | portable_values(name, layout, parts),
    }
    if avr:
        texts["_avr.S"] = assembly_values(name, manifest, layout, parts)
    return {
        f"thenar_{name}{ending}": render(
            f"{_FOLDER}thenar_NAME{ending}.j2", **common, **values, opening=_opening(name, manifest, ending, notes)
        )
        for ending, values in texts.items()
    }


def _opening(name: str, manifest: Manifest, ending: str, notes: Sequence[str]) -> str:
    """Return the comment that every file begins with."""
    what = {
        ".h": f"recognises {len(manifest.grasps)} grasp types from "
        f"{inputs_in_words(len(manifest.switches), len(manifest.joints))} of a glove",
        ".c": "tables and integer arithmetic; the header says how it is used",
        "_avr.S": "the adding up, on an AVR; the .c holds the tables",
    }[ending]
    lines = [
        f"thenar_{name}{ending}: {what}.",
        *map(comment, notes),
        "",
        f"From the tables {manifest.tables_sha256[:16]}; thenar {version('thenar')}, "
        f"template {_FOLDER}thenar_NAME{ending}.j2.",
    ]
    return "/* " + "\n".join(f"   {line}".rstrip() for line in lines).lstrip() + " */"


def _common_values(name: str, manifest: Manifest, layout: Layout, parts: Parts, avr: bool) -> dict[str, object]:
    n_classes, n_switches, n_joints = len(manifest.grasps), len(manifest.switches), len(manifest.joints)
    return {
        "name": name,
        "upper": name.upper(),
        "avr": avr,
        "classes": n_classes,
        "switches": n_switches,
        "n_groups": len(layout.groups),
        "n_joints": n_joints,
        "class_type": _unsigned(n_classes),
        "switch_type": _unsigned(n_switches),
        "code_type": f"uint{layout.code_bits}_t",
        "padding": layout.padding,
        "narrow": layout.entry_bits == 8,
        "parts": len(parts.firsts),
        "width": parts.width,
        "n_rows": layout.n_rows,
    }


def _unsigned(most: int) -> str:
    """Return the type of numbers up to `most` itself, which says "none"."""
    return "uint8_t" if most <= 255 else "uint16_t"


def _source_values(manifest: Manifest, layout: Layout, parts: Parts) -> dict[str, object]:
    joints = [lookup for lookup in lookups(layout) if lookup.joint is not None]
    searched = layout.bins == "search" and bool(joints)
    bins = sum(len(_bins(lookup)) for lookup in joints)
    steps = [step for lookup in joints for step in _steps(lookup)] if searched else []
    return {
        "table": table_lines(layout, manifest, parts),
        "bins": [line for lookup in joints if bins for line in _bin_lines(manifest, lookup)],
        "n_bins": bins,
        "paged": layout.bins == "direct" and bool(joints),
        "clamped": layout.bins == "trimmed" and bool(joints),
        "searched": searched,
        "thresholds": number_lines(steps),
        "n_thresholds": len(steps),
        "found": joints if searched else [],
        "n_found": len(joints),
        "open_scores": number_lines(layout.all_open.tolist()),
        "names": [string(grasp) for grasp in manifest.grasps],
        "longest_name": max(len(grasp.encode()) for grasp in manifest.grasps) + 1,
        "places": _place_lines(layout),
        "group_type": _unsigned(len(layout.groups)),
        "first_classes": number_lines(parts.firsts),
        "avr_macros": avr_macros(parts.width, layout.entry_bits),
    }


def _bins(lookup: Lookup) -> list[int]:
    return [] if lookup.joint is None else lookup.joint.bins.tolist()


def _bin_lines(manifest: Manifest, lookup: Lookup) -> list[str]:
    """Return the rows of a joint's codes as lines, and before them whose they are."""
    first = 0 if lookup.joint is None else lookup.joint.first
    name = manifest.joints[lookup.number].name
    return [*remark(comment(f"{name}, from code {first} on")), *number_lines(_bins(lookup))]


def _steps(lookup: Lookup) -> list[int]:
    return [] if lookup.joint is None else lookup.joint.thresholds.tolist()


def _place_lines(layout: Layout) -> list[str]:
    """Return a line per group: for each of its switches the number of the group and the bit."""
    return [
        "    " + " ".join(f"{{{g}, {1 << bit}}}," for bit in range(len(numbers)))
        for g, numbers in enumerate(layout.groups)
    ]


def _group_notes(manifest: Manifest, layout: Layout) -> list[str]:
    return [", ".join(comment(manifest.switches[number].name) for number in numbers) for numbers in layout.groups]


def _joint_notes(manifest: Manifest) -> list[str]:
    return [comment(f"{joint.name}, {_scale(joint)}") for joint in manifest.joints]


def _scale(joint: Calibration) -> str:
    if joint.unit == "raw":
        return "the glove's own codes"
    return f"code {joint.code_a} = {joint.value_a:g} {joint.unit}, {joint.code_b} = {joint.value_b:g} {joint.unit}"
