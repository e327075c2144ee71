"""What `thenar verify --firmware` says."""

from typing import TYPE_CHECKING, Any

import click

from .common import out

if TYPE_CHECKING:
    from thenar.compiler.artifact.verify_firmware import Difference, FirmwareVerification, TargetCheck

# Spelled out so that --help imports nothing.
KINDS = ("host", "avr", "cortex-m")


class Kinds(click.ParamType[tuple[str, ...]]):
    """Kinds of targets, with commas between them."""

    name = "targets"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        """Return the kinds, each once."""
        if isinstance(value, tuple):
            return value
        kinds = tuple(dict.fromkeys(part.strip() for part in str(value).split(",")))
        for kind in kinds:
            if kind not in KINDS:
                self.fail(f"there is no target {kind!r}: it takes {', '.join(KINDS)}, with commas between them")
        return kinds


def verdict(found: "FirmwareVerification | None") -> str:
    """Return what to do where verification does not hold: a new build answers no better where C and Python differ."""
    if found is not None and any(check.differing or check.misnamed for check in found.checks):
        what = "the answers of C differ, which is a fault of thenar or of the compiler"
        return f"DOES NOT HOLD: {what}: report it, with the first frame shown"
    return "DOES NOT HOLD: compile the build again"


def print_firmware(found: "FirmwareVerification") -> None:
    """Say of each part whether it answers as Python does, and of the first frame in which it does not."""
    console = out()
    console.print(f"firmware, on {found.rows} rows, {found.extreme} extreme and {found.random} random frames:")
    for check in found.checks:
        console.print(f"  {check.part}, {_HOW[check.answer]}: {_outcome(check)}")
        if check.misnamed:
            console.print(f"    {check.misnamed} of the grasp types have ANOTHER NAME")
        if check.first is not None:
            _print_difference(check.first)
    if not found.carried.present:
        console.print("  the build carries no firmware")
    elif found.carried.outdated:
        outdated = ", ".join(found.carried.outdated)
        console.print(f"  {outdated}: not what thenar makes of the build now; compile it again")
    else:
        console.print("  the build carries the firmware that thenar makes of it now")


_HOW = {"classify": "every frame from nothing", "update": "every frame from the one before"}


def _outcome(check: "TargetCheck") -> str:
    if check.differing:
        return f"{check.differing} of {check.frames} frames DIFFER; the first:"
    counted = "" if check.worst is None else f", at most {check.worst} {check.unit}"
    stack = "" if check.stack is None else f" and {check.stack} bytes of stack"
    return f"every score and grasp type of {check.frames} frames is Python's{counted}{stack}"


def _print_difference(first: "Difference") -> None:
    console = out()
    codes = " ".join(map(str, first.codes)) or "none"
    console.print(f"    {first.frame}: closed {', '.join(first.closed) or 'none'}; codes {codes}")
    for who, grasp, scores in (
        ("Python", first.grasp, first.scores),
        ("compiled", first.compiled_grasp, first.compiled_scores),
    ):
        console.print(f"    {who}: {grasp}, scores {' '.join(map(str, scores))}")
