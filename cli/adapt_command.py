"""`thenar adapt`: change a build to fit the person who wears the glove."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .parameters import OutputFolder, add_type_option, existing_file, existing_folder, keep_apart
from .printing import echo, json_flag, progress, show, warning

if TYPE_CHECKING:
    from thenar.compiler.artifact.adapting import AdaptedBuild


@click.command("adapt")
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.argument("mine", metavar="MINE.grasps", type=existing_file)
@click.option("-o", "--output", metavar="DIR", type=OutputFolder(), required=True, help="The folder to write.")
@add_type_option
@json_flag
def command(build: Path, mine: Path, output: Path, add_type: tuple[str, ...]) -> None:
    """Adapt BUILD to one person, from a few trials in MINE.grasps: two of each type are enough to help.

    The result is a build with the same switches, joints and thresholds, and other scores. Types may be missing: they
    change as the others do on average. Recordings of other people are not needed. With --add-type, BUILD learns a type
    that nobody else has.

    It needs no more than `pip install thenar`; only the firmware needs thenar[compiler]. The same input gives the same
    bytes.

    \b
    Example:
        thenar adapt build/ mine.grasps -o mine/
        thenar adapt build/ mine.grasps --add-type stapler -o mine/
        thenar run mine/ --replay mine.grasps
    """
    from thenar.compiler.artifact.adapting import adapt
    from thenar.compiler.recordings.graspset import GraspSet

    keep_apart(mine, output)
    with progress("adapting"):
        made = adapt(build, GraspSet.load(mine), output=output, add_type=add_type)
    for sentence in made.warnings:
        warning(sentence)
    show(made.manifest, lambda _: _print(made, output))


def _print(made: "AdaptedBuild", folder: Path) -> None:
    from thenar.compiler.facts import facts

    adapted = next(fact for fact in facts(made.manifest) if fact.label == "adapted")
    total = made.manifest.rates[0].total
    before, after = (f"{100 * count / total:.1f} %" for count in (made.before, made.after))
    echo(f"{folder}: adapted {adapted.text}")
    echo(f"recognised of these trials: {before} before, {after} after, each by a build adapted to all others")
    if made.firmware:
        echo(f"firmware: {made.firmware}")
    else:
        where = shlex.quote(str(folder))
        echo(f'no firmware: pip install "thenar[compiler]", then thenar firmware {where} --target NAME -o firmware/')
