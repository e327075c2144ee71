"""`thenar plan`: plan how the hands of a scene hold objects that have no postures yet."""

from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.text import Text

from .common import OutputFile, jobs_option, json_flag, keep_apart, out, overwrite_flag, progress, show, table
from .options import scene_name

if TYPE_CHECKING:
    from thenar.simulator.planning.plan import Planned


@click.command("plan")
@click.argument("scene", type=scene_name)
@click.option(
    "-o", "--output", type=OutputFile(".json"), required=True, metavar="POSTURES.json", help="Postures to write."
)
@overwrite_flag
@click.option("--anew", is_flag=True, help="Plan everything, also objects that are already planned.")
@jobs_option()
@json_flag
def command(scene: str, output: Path, anew: bool, jobs: int) -> None:
    """Plan how hands of all lengths in SCENE hold each of its objects; SCENE is a TOML file, or a shipped scene's name.

    Shipped objects are already planned. To use the postures, name the file in a scene: postures = "POSTURES.json".

    \b
    Example:
        thenar plan scene.toml -o postures.json
    """
    from thenar.simulator.planning.plan import plan_scene
    from thenar.simulator.scenes.decode import load_scene, own_file

    keep_apart(own_file(scene), output)
    loaded = load_scene(scene)
    with progress(f"planning {loaded.name}") as report:
        postures, planned = plan_scene(loaded, jobs, report, anew=anew)
    postures.save(output)
    show(planned, _print, output)


def _print(planned: "list[Planned]", path: Path) -> None:
    console, numbers = out(), ("hands mm", "gap mm", "sunk mm", "not balanced")
    title = Text("Planned postures, worst of all hand lengths", "bold")
    postures = table(("grasp type", "object", *numbers), numbers, title)
    postures.title_justify = "left"
    for one in planned:
        lengths = [held.length_mm for held in one.entry.held]
        postures.add_row(
            Text(one.entry.grasp),
            Text(one.entry.object),
            f"{lengths[0]:g} - {lengths[-1]:g}",
            f"{one.gap_mm:.1f}",
            f"{one.sunk_mm:.1f}",
            f"{one.imbalance:.0%}",
        )
    if planned:
        console.print(postures)
    console.print(f"{path}: {len(planned)} object(s) planned" + ("" if planned else ": all were planned already"))
