"""`thenar frontier`: the trade-off between accuracy and time."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from thenar.compiler.text import duration
from thenar.drivers.names import printable
from thenar.runtime.recipe import AUTO

from .consoles import Text
from .options import (
    TrainingCommand,
    asked_settings,
    method_list,
    prices_of,
    prices_option,
    recipe_options,
    trainer_option,
)
from .parameters import Number, OneOf, OutputFolder, existing_file, jobs_option, seed_range
from .printing import err, json_flag, out, progress, say, show, table

if TYPE_CHECKING:
    from thenar.compiler.frontier.points import Frontier


_SEARCHED = ("repeats", "finalists", "seed", "by", "sensors", "price")
_WORDS = ("inputs", "placement", "rounds, bits", "wiring")
_SIZES = ("flash", "RAM")


def _timed() -> tuple[str, ...]:
    from thenar.compiler.firmware.targets import timed

    return timed()


@click.command("frontier", cls=TrainingCommand)
@click.argument("recordings", metavar="SET.grasps", type=existing_file)
@click.option(
    "-o", "--output", type=OutputFolder(), required=True, help="Folder for tables, the picture and the store."
)
@click.option("--glove", type=existing_file, help="A glove.toml: try its wiring too, and choose by its ports.")
@click.option(
    "--target",
    type=OneOf("target", _timed),
    default="host",
    show_default=True,
    help="Deployment target. Times of pi are a guess unless the command runs on one.",
)
@click.option(
    "--budget-us",
    type=Number(min=0, min_open=True),
    help="Pick the most accurate point within this frame time. A CyberGlove takes 260 µs plus 337 µs for "
    "each sensor read, 6,323 µs for 18: a small budget excludes its joints.",
)
@click.option(
    "--rate", type=Number(0, 1, min_open=True), help="Pick the fastest point of at least this accuracy, 0 to 1."
)
@click.option(
    "--joint-us",
    type=Number(0, 60_000_000, min_open=True),
    help="Time to read all joints.  [default: a CyberGlove's record; unknown and omitted for other joints]",
)
@click.option(
    "--methods",
    type=method_list,
    help="Placement methods to build from.  [default: elimination and ID3, by cost with --glove]",
)
@recipe_options("sensors", "price", "have", "never")
@prices_option
@trainer_option(AUTO)
@click.option("--rounds", type=click.IntRange(1, 300), default=100, show_default=True, help="Most rounds to try.")
@click.option("--repeats", type=click.IntRange(1, 1000), default=3, show_default=True, help="Repeats of the folds.")
@click.option(
    "--finalists", type=click.IntRange(1), default=12, show_default=True, help="Placements to refine and price."
)
@click.option("--seed", type=seed_range, default=1, show_default=True, help="Seed of folds.")
@click.option(
    "--by",
    type=click.Choice(("subject", "trial")),
    help="Choose points by left-out subjects, or by trials of all subjects.  [default: subject, if several]",
)
@click.option(
    "--adapt",
    "own_trials",
    type=click.IntRange(0, 1000),
    default=0,
    metavar="N",
    help="Also print the accuracy of new subjects before and after N own trials of each type.",
)
@jobs_option()
@json_flag
@click.pass_context
def command(
    context: click.Context,
    /,
    recordings: Path,
    output: Path,
    glove: Path | None,
    budget_us: float | None,
    rate: float | None,
    methods: tuple[str, ...] | None,
    **asked: Any,
) -> int:
    """Show the trade-off between accuracy and time: which switches, joints, rounds, tables and wirings pay.

    Every placement is screened by a nested cross-validation. Those near the front are refined, priced for the target,
    simulated there, and put on one picture. OUTPUT gets frontier.json, frontier.csv, frontier.svg and store.sqlite,
    from which an interrupted run continues.

    \b
    Example:
        thenar frontier set.grasps -o frontier/ --budget-us 1500
        thenar frontier set.grasps -o frontier/ --sensors 8
        thenar compile set.grasps -o build/ --from frontier/frontier.json --point 7
    """
    from thenar.compiler.frontier import words
    from thenar.compiler.frontier.find import find_frontier
    from thenar.compiler.frontier.search import Search
    from thenar.compiler.placement.constraints import Limits
    from thenar.compiler.placement.methods.base import usual
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.harness.loading import load_harness
    from thenar.runtime.recipe import Recipe

    if methods and (asked["sensors"] or asked["price"] is not None):
        raise click.UsageError("--methods choose switches, --sensors and --price all kinds: give one of them.")
    if budget_us is not None and rate is not None:
        raise click.UsageError("--budget-us and --rate each pick a point: give one of them.")
    harness = None if glove is None else load_harness(glove)
    grasp_set = GraspSet.load(recordings)
    methods = methods or usual(wired=harness is not None or bool(grasp_set.taxel_columns))
    kept = Recipe(price=asked["price"], have=asked.pop("have"), never=asked.pop("never"))
    limits = Limits.of(kept, grasp_set, {}, prices=prices_of(grasp_set, asked.pop("prices")))
    rounds, training = asked["rounds"], asked_settings(context, asked)
    search = Search(
        methods=methods,
        rounds=rounds,
        trainer=training.pop("trainer"),
        settings={name: value for name, value in training.items() if name != "rounds"},
        **{name: asked.pop(name) for name in _SEARCHED},
    )
    with progress("frontier") as report:
        found = find_frontier(
            grasp_set,
            output,
            source=printable(recordings.name),
            harness=harness,
            search=search,
            budget_us=budget_us,
            rate=rate,
            limits=limits,
            report=report,
            rough=lambda early: say(f"rough, from screening: {words.rough_of(early)}; drawn in {output}"),
            **asked,
        )
    show(found, _print, output)
    if found.wanted and found.picked is None:
        err().print(f"no point qualifies: {found.wanted} is beyond this frontier; relax it, or leave it out")
        return 1
    return 0


def _print(found: "Frontier", output: Path) -> None:
    from thenar.compiler.frontier.words import featured

    print_frontier(found)
    best = featured(found)
    if best is not None:
        made = f"thenar compile {found.source} -o build/ --from {output / 'frontier.json'} --point {best.number}"
        out().print(f"next: {made}", soft_wrap=True)


def print_frontier(frontier: "Frontier") -> None:
    """Print the points, the picked one bold; then the omissions, and the caption of the picture."""
    from thenar.compiler.evaluation.rates import interval
    from thenar.compiler.frontier import words

    rates, elements = words.rates_of(frontier), words.counted_of(frontier)
    numbers = (*(f"{what} %" for what in rates), words.of_time(frontier, "frame"), *_SIZES)
    wanted = f"; {frontier.wanted}: point {frontier.picked}" if frontier.picked is not None else ""
    title = f"The best of {frontier.combinations:,} combinations, {frontier.source} on {frontier.machine}{wanted}"
    grid = table(("point", elements, *_WORDS, *numbers), ("point", elements, *numbers), title)
    for point in frontier.points:
        setting = point.setting
        trained = setting.rounds if setting.usual else words.training_of(setting)
        grid.add_row(
            *(str(point.number), str(point.size), setting.inputs, words.way_of(setting)),
            *(f"{trained}, {setting.width}", words.wiring_of(setting)),
            *(interval(rate(point)) for rate in rates.values()),
            f"{duration(point.frame.us)} {point.frame.how}",
            *(f"{point.flash:,}", f"{point.ram:,}"),
            style="bold" if point.number == frontier.picked else "",
        )
    console, folds, remarks = out(), words.folds_of(frontier), words.remarks_on_rates(frontier)
    console.print(grid)
    console.print(Text(f"{folds}. Accuracy in % with 95 % intervals. {remarks} Flash, RAM: bytes.", "dim"))
    for missing in frontier.skipped:
        console.print(Text(missing, "yellow"))
    console.print()
    console.print(Text(words.summary(frontier), "bold"))
