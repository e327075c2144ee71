"""`thenar frontier`: what accuracy costs in time."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from thenar.compiler.frontier.targets import TARGETS

from .common import any_path, err, existing_file, existing_folder, json_flag, out, print_json, progress
from .methods import WithMethods, method_names

if TYPE_CHECKING:
    from thenar.compiler.frontier.points import Frontier


@click.command("frontier", cls=WithMethods)
@click.argument("recordings", metavar="SET.grasps", type=existing_file)
@click.option("-o", "--output", type=any_path, required=True, help="Folder for tables, pictures and the store.")
@click.option("--glove", type=existing_file, help="A glove.toml: try its wiring as well, and choose by its ports.")
@click.option("--target", type=click.Choice(TARGETS), default="host", show_default=True, help="What classifies.")
@click.option("--budget-us", type=click.FloatRange(min=0, min_open=True), help="Pick the best within so long a frame.")
@click.option("--rate", type=click.FloatRange(0, 1, min_open=True), help="Pick the fastest that recognises this share.")
@click.option("--build", type=existing_folder, help="A build of yours: mark it on the pictures.")
@click.option("--stream", type=existing_file, help="A set of whole movements: measure decision latency on it.")
@click.option(
    "--methods",
    callback=method_names,
    help="Placement methods to build from, by commas.  [default: elimination and ID3, by cost with --glove]",
)
@click.option(
    "--rivals", callback=method_names, help="Methods to compare them with, by commas, or none.  [default: most rivals]"
)
@click.option("--rounds", type=click.IntRange(1, 300), default=300, show_default=True, help="The most rounds to try.")
@click.option("--repeats", type=click.IntRange(1), default=3, show_default=True, help="Repeats of the folds.")
@click.option(
    "--finalists", type=click.IntRange(1), default=12, show_default=True, help="Placements to look at closely."
)
@click.option("--max-bins", type=click.IntRange(2), help="At most so many bins a joint.  [default: no limit]")
@click.option("--seed", type=int, default=1, show_default=True, help="Seed of folds and stream.")
@click.option("--jobs", type=int, default=-1, show_default=True, help="Worker processes; -1: all cores.")
@click.option(
    "--dask", "cluster", metavar="ADDRESS", help="Work on the cluster of this Dask scheduler, such as tcp://host:8786."
)
@json_flag
def command(budget_us: float | None, rate: float | None, as_json: bool, **asked: Any) -> int:
    """Show what accuracy costs in time: which switches, joints, rounds, tables, wirings and decisions are worth it.

    Every placement is screened by an honest cross-validation; those near the front are looked at closely, priced for
    the target, simulated there, and put on one picture. OUTPUT gets frontier.json, frontier.csv, three pictures and
    store.jsonl, from which an interrupted run goes on.

    \b
    Example:
        thenar frontier set.grasps -o frontier/ --budget-us 1500
        thenar compile set.grasps -o build/ --from frontier/frontier.json --point 7
    """
    from thenar.compiler.frontier.preparing import Request, run_frontier
    from thenar.compiler.frontier.study import Wanted

    if budget_us is not None and rate is not None:
        raise click.UsageError("--budget-us and --rate each pick a point: give one of them.")
    request = Request(wanted=Wanted(budget_us, rate), **asked)
    with progress("frontier") as report:
        found = run_frontier(request, report)
    if as_json:
        print_json(found)
    else:
        _print(found, request.output)
    if request.wanted.words and found.picked is None:
        err().print(f"no point suits: {request.wanted.words} is beyond this frontier")
        return 1
    return 0


def _print(found: "Frontier", output: Path) -> None:
    from thenar.compiler.frontier.drawing.words import featured

    from .frontier_tables import print_frontier

    print_frontier(found)
    best = featured(found)
    if best is not None:
        made = f"thenar compile {found.source} -o build/ --from {output / 'frontier.json'} --point {best.number}"
        out().print(f"next: {made}", soft_wrap=True)
