"""`thenar verify`: check that the deployed tables match the trained model."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.compiler.text import INDEPENDENT, counted

from .parameters import ListOf, existing_file, existing_folder
from .printing import echo, json_flag, out, progress, show, table

if TYPE_CHECKING:
    from thenar.compiler.artifact.verify import FaultCheck, Verification
    from thenar.compiler.artifact.verify_firmware import FirmwareVerification, TargetCheck
    from thenar.compiler.model.compare import WorstCase

_SHOWN = 20


def _kinds() -> tuple[str, ...]:
    from thenar.compiler.firmware.targets import kinds

    return kinds()


@click.command("verify")
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.argument("recordings", metavar="SET.grasps", type=existing_file)
@click.option(
    "--firmware",
    type=ListOf("target", _kinds),
    default=(),
    help="Also compile the classifier for these targets, and run it there or in a simulator.",
)
@click.option("--faults", is_flag=True, help="Print the accuracy under each fault: lost or stuck inputs, dead ports.")
@json_flag
def command(build: Path, recordings: Path, firmware: tuple[str, ...], faults: bool) -> int:
    """Classify every row with ensemble, float tables and integer tables, and check the differences against bounds.

    The worst integer error is not searched for among the rows: it is calculated over all possible frames.

    With --firmware, every score, grasp type, margin and probability of the compiled classifiers, and every state of
    segments that were learnt, is compared with Python's: on every row, on 10,000 random frames and on all extreme ones.
    host runs with sanitizers; avr runs in simavr on an ATmega328P, or on an ATmega2560 if the build does not fit.

    With --faults, every fault is applied to every row: each input lost, with and without its substitute row; each input
    stuck at each of its values; each port, chip and board of the build's scan map dead; and any two inputs lost.

    Exits with 1 if a bound does not hold or a result differs. The recordings may be others than those that the build
    was compiled from.

    \b
    Example:
        thenar verify build/ set.grasps
        thenar verify build/ set.grasps --firmware host,avr
        thenar verify build/ others.grasps --faults
    """
    from thenar.compiler.artifact.verify import verify, verify_faults
    from thenar.compiler.recordings.graspset import GraspSet

    if faults and firmware:
        raise click.UsageError("--faults measures the tables and --firmware compiles them: give one of them.")
    grasp_set = GraspSet.load(recordings)
    if faults:
        with progress("applying faults to rows") as report:
            counted = verify_faults(build, grasp_set, report)
        show(counted, _print_faults)
        return 0
    with progress("verifying, compiling and running firmware" if firmware else "verifying") as report:
        found = verify(build, grasp_set, firmware, report)
    show(found, _print)
    return 0 if found.holds else 1


def _print(found: "Verification") -> None:
    trials, worst = counted(found.trials, "trial"), found.worst
    echo(f"{counted(found.rows, 'row')} of {trials}; the build was trained on {found.trained_on:,} of these trials")
    collapse = f"at most {found.collapse_difference:.3g} of a unit, allowed {found.collapse_bound:.3g}"
    echo(f"ensemble to float tables: {collapse}")
    echo(f"float tables to integers: at most {found.integer_difference:.3f} steps, allowed {found.integer_bound:g}")
    _print_margin(f"{found.safe_margin:g} steps", found)
    frame = f"{len(worst.closed)} switches closed, codes {' '.join(map(str, worst.codes)) or 'none'}"
    echo(
        f"worst possible frame: {worst.leader} loses {worst.loss:.3f} steps of its lead over {worst.competitor}, "
        f"allowed {worst.bound:.3f} ({frame})"
    )
    _print_margin(f"{worst.safe_margin:.3f} steps, which covers the worst frames", worst)
    echo(f"largest possible sum, with or without missing inputs: {worst.reach}, allowed {worst.limit}")
    whose = {0: "trials not trained on", found.trials: "trials trained on"}.get(
        found.trained_on, f"{found.trained_on} of {trials} trained on"
    )
    for each in found.recognised:
        rate = f"{100 * each.rate:.1f} % [{100 * each.low:.1f}, {100 * each.high:.1f}]"
        hits = f"{each.integers:,} of {each.total:,} {each.unit}; of the ensemble {each.ensemble:,}"
        echo(f"accuracy of the integers, {whose}: {rate}, {hits}")
    if (none := found.nothing_held) is not None:
        empty = f", and for {none.detected:,} of {none.empty:,} rows of nothing held" if none.empty else ""
        echo(f"nothing held, predicted for {none.missed:,} of {none.grasps:,} rows of grasps{empty}")
    if found.independent:
        echo(INDEPENDENT)
    echo(f"rows that change class: {len(found.changed)}")
    for row in found.changed[:_SHOWN]:
        line = f"  row {row.row}: {row.ensemble} becomes {row.integers}, recorded {row.recorded}"
        echo(f"{line} (margin {row.margin:.1f} steps)")
    if len(found.changed) > _SHOWN:
        echo(f"  and {len(found.changed) - _SHOWN} more: --json lists them all")
    if found.firmware is not None:
        print_firmware(found.firmware)
    echo("holds" if found.holds else verdict(found.firmware))


def _print_margin(margin: str, found: "Verification | WorstCase") -> None:
    echo(f"margin above {margin}: {found.covered} rows, of which {found.covered_changed} change class")


def _print_faults(found: "FaultCheck") -> None:
    worst = found.worst
    numbers = ("lost, %", "points less", "stuck, %")
    lines = table(("input", *numbers, "at"), numbers, "Accuracy on trials with one input lost, or stuck at its worst")
    for each in sorted(found.inputs, key=lambda each: each.lost):
        rates = (f"{100 * count / worst.total:.1f}" for count in (each.lost, worst.correct - each.lost, each.stuck))
        lines.add_row(each.name, *rates, each.value)
    out().print(lines)
    echo(f"without a fault: {100 * worst.correct / worst.total:.1f} %, {worst.correct:,} of {worst.total:,} trials")
    echo("the worst of each kind:")
    for sentence in worst.sentences:
        echo(f"  {sentence}")


def verdict(found: "FirmwareVerification | None") -> str:
    """Return the advice for a failed verification: a new build does not help where C and Python differ."""
    if found is not None and any(check.differing or check.misnamed for check in found.checks):
        what = "the C results differ, which is a bug of thenar or of the compiler"
        return f"DOES NOT HOLD: {what}: report it, with the first frame shown"
    return "DOES NOT HOLD: compile the build again"


def print_firmware(found: "FirmwareVerification") -> None:
    """Print for each part whether its results match Python's, and the first frame in which they do not."""
    echo(f"firmware, on {found.rows} rows, {found.extreme} extreme and {found.random} random frames:")
    for check in found.checks:
        echo(f"  {check.part}{', inputs missing' if check.missing else ''}: {_outcome(check)}")
        if check.misnamed:
            echo(f"    {check.misnamed} of the grasp types have ANOTHER NAME")
        if (first := check.first) is not None:
            said = zip((first.grasp, first.compiled_grasp), (first.scores, first.compiled_scores), strict=True)
            python, compiled = (f"{grasp}, scores {' '.join(map(str, scores))}" for grasp, scores in said)
            echo(f"    {first.frame}: Python {python}; compiled {compiled}; --json has the frame")
    if found.outdated is None:
        echo("  the build carries no firmware")
    elif found.outdated:
        outdated = ", ".join(found.outdated)
        echo(f"  {outdated}: not what thenar makes of the build now; compile it again")
    else:
        echo("  the build carries the firmware that thenar makes of it now")


def _outcome(check: "TargetCheck") -> str:
    if check.differing:
        return f"{check.differing} of {check.frames} frames DIFFER; the first:"
    counted = "" if check.worst is None else f", at most {check.worst} {check.unit}"
    stack = "" if check.stack is None else f" and {check.stack} bytes of stack"
    what = "score, grasp type, margin and probability" if check.shares else "score and grasp type"
    if check.states:
        what = "score, grasp type, margin, probability and state of a segment"
    return f"every {what} of {check.frames} frames matches Python's{counted}{stack}"
