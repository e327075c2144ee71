"""`thenar teach`: learn the task that several demonstrations have in common."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.compiler.text import counted

from .parameters import OutputFile, existing_file, existing_folder, keep_apart, overwrite_flag, overwrites
from .printing import echo, json_flag, out, progress, show, table, warning

if TYPE_CHECKING:
    from thenar.compiler.artifact.teaching import Task


@click.command("teach")
@click.argument("demonstrations", metavar="DEMO...", nargs=-1, required=True, type=existing_file)
@click.option("-b", "--build", type=existing_folder, required=True, help="The build that recognises.")
@click.option(
    "-o",
    "--output",
    type=OutputFile(".json"),
    required=True,
    help="The task to write; a behaviour tree with the same name (.xml) is written too.",
)
@click.option(
    "--preshape", metavar="NAME", help="The preshapes of the steps: barrett_bh8, parallel_gripper or a .toml file."
)
@click.option("--transitions", type=existing_file, help="Counts of which type follows which, from thenar segment.")
@overwrite_flag
@json_flag
def command(
    demonstrations: tuple[Path, ...], build: Path, output: Path, preshape: str | None, transitions: Path | None
) -> None:
    """Find the sequence of grasps that demonstrations share. They are recordings (.mcap) of the inputs of BUILD,
    or sets of whole movements (.grasps), each stream of which counts as one.

    A grasp becomes a step if most demonstrations have it at that place. A step has its preshape, the median of each
    joint, its duration, and the types that may follow.

    \b
    Example:
        thenar teach demo1.mcap demo2.mcap demo3.mcap -b build/ -o task.json --preshape barrett_bh8
    """
    from thenar.compiler.artifact.teaching import Demonstration, behaviour_tree, task_json, taught
    from thenar.compiler.artifact.teaching import demonstrations as shown_in
    from thenar.compiler.movements.transitions import Transitions
    from thenar.runtime import Build
    from thenar.runtime.files import write_atomically
    from thenar.runtime.preshape import load_preshapes

    tree = output.with_suffix(".xml")
    if tree.exists() and not overwrites(click.get_current_context()):
        raise click.UsageError(f"{tree} already exists: add --overwrite to replace it")
    keep_apart(*demonstrations, transitions, output, tree)
    loaded = Build.load(build)
    preshapes = None if preshape is None else load_preshapes(preshape)
    if preshapes is not None and (lacking := preshapes.check(loaded.grasps)):
        warning(lacking)
    graph = None if transitions is None else Transitions.load(transitions)
    shown = list[Demonstration]()
    with progress("finding segments") as report:
        for done, path in enumerate(demonstrations):
            report(done, len(demonstrations))
            shown += shown_in(build, [path])
    task = taught(loaded, shown, output.stem, preshapes, graph)
    write_atomically(output, task_json(task))
    write_atomically(tree, behaviour_tree(task))
    show(task, lambda _: _print(task, output, tree))


def _print(task: "Task", output: Path, tree: Path) -> None:
    total = len(task.demonstrations)
    grid = table(("step", "grasp", "shown", "preshape", "held s", "then"), ("step", "held s"), title=task.name)
    for number, step in enumerate(task.steps, 1):
        held = f"{step.median_s:.2f} +- {step.spread_s:.2f}"
        shown = f"{step.shown} of {total}"
        grid.add_row(str(number), step.grasp, shown, step.preshape or "", held, ", ".join(step.then))
    out().print(grid)
    echo(f"{counted(len(task.steps), 'step')} of {counted(total, 'demonstration')}: {output} and {tree}")
