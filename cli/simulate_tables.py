"""What `thenar simulate` prints on the terminal."""

from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.running.explain import Explanation
from thenar.simulator.running.pipeline import DEFAULT_CONTACT
from thenar.simulator.running.report import GraspReport, Report, StepReport

from .common import err, out, warning

if TYPE_CHECKING:  # simulating needs no compiler; ablation does
    from thenar.compiler.evaluation.ablation import Ablation, Change, Recognised, Variant

_SHOWN = 10  # unsettled repetitions that are named one by one
_OWN = "dim"  # how own steps look


def print_report(report: Report, path: Path) -> None:
    """Print what came out, by grasp type and by step, and warn of what did not settle."""
    console = out()
    console.print(
        f"{path}: {report.rows} rows, simulated: scene {report.scene}, seed {report.seed}, "
        f"{len(report.subjects)} subject(s), {report.repetitions} grasps in {report.seconds:.1f} s"
    )
    console.print()
    console.print(_grasps(report))
    if report.lost_frames:
        console.print(f"{report.lost_frames} frames did not arrive; what is read then is what arrived last")
    console.print()
    console.print(_steps(report.steps))
    _warn_of_unsettled(report)


def _table(title: str, *columns: str) -> Table:
    """Return a table whose first column is a name, and is never cut."""
    table = Table(title=Text(title, "bold"), title_justify="left")
    for number, column in enumerate(columns):
        table.add_column(Text(column), justify="right" if number else "left", no_wrap=not number)
    return table


def _grasps(report: Report) -> Table:
    table = _table(
        "Grasps, simulated",
        *("grasp type", "grasps", "rows", "switches ON", "from - to", "distinct patterns", "no contact", "unsettled"),
        *("N between switches", "largest residual N", "N mm"),
    )
    for grasp in report.grasps:
        table.add_row(Text(grasp.grasp), *_counts(grasp))
    return table


def _counts(grasp: GraspReport) -> tuple[str, ...]:
    return (
        str(grasp.repetitions),
        str(grasp.rows),
        f"{grasp.switches_mean:.1f}",
        f"{grasp.switches_least} - {grasp.switches_most}",
        str(grasp.patterns),
        str(grasp.no_contact),
        str(grasp.unsettled),
        f"{grasp.between_n:.1f}",
        f"{grasp.residual_n:.2f}",
        f"{grasp.residual_nmm:.1f}",
    )


def _steps(steps: tuple[StepReport, ...]) -> Table:
    columns = ("step", "whose", "calls", "grasps", "draws", "seconds", "us a grasp", "share")
    table = _table("Cost of every effect (own: a step that every scene has)", *columns)
    for step in steps:
        table.add_row(
            Text(step.name),
            _whose(own=step.own),
            str(step.calls),
            str(step.grasps),
            str(step.draws),
            f"{step.seconds:.3f}",
            f"{step.us_a_grasp:.1f}",
            f"{step.share:.1%}",
            style=_OWN if step.own else "",
        )
    table.add_section()
    total = sum(step.seconds for step in steps)
    table.add_row("all", "", "", "", str(sum(step.draws for step in steps)), f"{total:.3f}", f"{_us(steps):.1f}", "")
    return table


def _whose(*, own: bool) -> str:
    return "own" if own else "effect"


def _us(steps: tuple[StepReport, ...]) -> float:
    return sum(step.us_a_grasp for step in steps)


def _warn_of_unsettled(report: Report) -> None:
    if not report.unsettled:
        return
    what = "kept as asked" if report.kept_unsettled else "left out of the set (--keep-unsettled keeps them)"
    console = err()
    count = f"{len(report.unsettled)} of {report.repetitions} grasps"
    warning(f"{count} cannot be trusted, and are {what}:")
    for one in report.unsettled[:_SHOWN]:
        console.print(
            f"  subject {one.subject}, {one.grasp} with {one.object}, repetition {one.repetition}: {one.why}",
            soft_wrap=True,
        )
    if len(report.unsettled) > _SHOWN:
        console.print(f"  and {len(report.unsettled) - _SHOWN} more, which --json names")


def print_explanation(explanation: Explanation) -> None:
    """Print the steps of a scene in the order in which they run, what each does and costs, and what to expect."""
    console = out()
    table = _table(
        f"Steps of scene {explanation.scene}, in order (own: a step that every scene has)",
        *("step", "whose", "stage", "acts", "draws a grasp", "us a grasp", "share"),
    )
    for step in explanation.steps:
        table.add_row(
            Text(step.name),
            _whose(own=step.own),
            step.stage,
            "on bytes" if step.on_wire else "in time" if step.timed else "",
            f"{step.draws_a_grasp:.1f}",
            f"{step.us_a_grasp:.1f}",
            f"{step.share:.1%}",
            style=_OWN if step.own else "",
        )
    console.print(table)
    console.print()
    for step in explanation.steps:
        text = Text(f"{step.name}: {step.summary}\n", _OWN if step.own else "")
        console.print(text.append(f"    {', '.join(step.reads) or 'nothing'} -> {', '.join(step.writes)}"))
    console.print()
    console.print(_expected(explanation))


def _expected(explanation: Explanation) -> str:
    frames = "every frame" if explanation.timed else "one frame a grasp, as no effect lives in time"
    wire = ", sent and received as bytes" if explanation.on_wire else ""
    return (
        f"simulated: {frames}{wire}\n"
        f"measured here on {explanation.measured} grasps of {explanation.conditions} conditions: "
        f"{explanation.us_a_grasp:.0f} us a grasp on one core; {explanation.repetitions} grasps on "
        f"{explanation.workers} core(s) should take about {explanation.expected_s:.1f} s, and the start of processes"
    )


def print_ablation(ablation: "Ablation") -> None:
    """Print what each effect does to the recognition rates and to the time."""
    console = out()
    whole = ablation.variants[0]
    columns = [f"{one.inputs}{what}" for one in whole.rates for what in ("", ", change")]
    table = _table(
        f"Scene {ablation.scene} without each of its effects, simulated",
        *("without", *columns, "us a grasp", "change", "unsettled"),
    )
    for variant in ablation.variants:
        cells = [cell for one in variant.rates for cell in _cells(one)]
        table.add_row(Text(_name(variant)), *cells, *_times(variant, whole), str(variant.unsettled))
    console.print(table)
    console.print(
        f"LogitBoost of {ablation.rounds} rounds on all switches, all joints and both, {ablation.folds} folds within "
        "each subject; rates in %, with 95 % intervals;\n"
        "changes in percentage points, of grasps that settled with and without; time of a few grasps, best of several"
    )
    for variant in ablation.variants:
        if variant.without is not None and EFFECTS[variant.without].model is not None:
            console.print(f"without {variant.without}: {DEFAULT_CONTACT} closes the hands in its place")


def _name(variant: "Variant") -> str:
    return "(nothing)" if variant.without is None else variant.without


def _cells(one: "Recognised") -> tuple[str, str]:
    rate = one.rate
    return f"{100 * rate.mean:.1f} [{100 * rate.low:.1f}, {100 * rate.high:.1f}]", _change(one.change)


def _change(change: "Change | None") -> str:
    return "" if change is None else f"{100 * change.mean:+z.1f} [{100 * change.low:+z.1f}, {100 * change.high:+z.1f}]"


def _times(variant: "Variant", whole: "Variant") -> tuple[str, str]:
    change = "" if variant is whole else f"{variant.us_a_grasp - whole.us_a_grasp:+.0f}"
    return f"{variant.us_a_grasp:.0f}", change
