"""`thenar adapt`: change a build to fit the person who wears the glove."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from thenar.compiler.text import counted

from .parameters import Number, OutputFolder, existing_file, existing_folder, keep_apart
from .printing import echo, json_flag, progress, show, warning

if TYPE_CHECKING:
    from thenar.compiler.artifact.adapting import AdaptedBuild


@click.command("adapt")
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.argument("mine", metavar="MINE.grasps", type=existing_file)
@click.option("-o", "--output", metavar="DIR", type=OutputFolder(), required=True, help="The folder to write.")
@click.option(
    "--strength",
    type=Number(1e-3, 1e6),
    help="Pull towards BUILD.  [default: the one that was chosen on people left out, or 1]",
)
@json_flag
def command(build: Path, mine: Path, output: Path, strength: float | None) -> None:
    """Adapt BUILD to one person, from a few trials in MINE.grasps: two of each type are enough to help.

    The result is a build with the same switches, joints and thresholds, and other scores. Types may be missing: they
    are changed as the others are on average. Recordings of other people are not needed.

    It needs no more than `pip install thenar`, and a second or two on a single-board computer; only the firmware needs
    thenar[compiler]. The same input gives the same bytes.

    \b
    Example:
        thenar adapt build/ mine.grasps -o mine/
        thenar run mine/ --replay mine.grasps
    """
    from thenar.compiler.artifact.adapting import adapt
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.samples import select_inputs
    from thenar.runtime.build import load_manifest

    keep_apart(mine, output)
    manifest, recordings = load_manifest(build), GraspSet.load(mine)
    if not manifest.knows_none:
        recordings = recordings.without_none()
    bits, codes = select_inputs(recordings, manifest)
    frames = np.hstack([bits, codes], dtype=np.uint16)
    with progress("adapting"):
        made = adapt(
            build,
            frames,
            recordings.grasps,
            output,
            trials=recordings.trial_ids,
            strength=strength,
            recordings=recordings,
        )
    for sentence in made.warnings:
        warning(sentence)
    show(made.manifest, lambda _: _print(made, output))


def _print(made: "AdaptedBuild", folder: Path) -> None:
    adapted = made.manifest.adapted
    assert adapted is not None
    types = sum(count > 0 for count in adapted.counts)
    before, after = (f"{100 * count / adapted.total:.1f} %" for count in (adapted.before, adapted.after))
    echo(
        f"{folder}: adapted to {counted(adapted.total, 'trial')} of {counted(types, 'type')}, "
        f"with strength {adapted.strength:g}"
    )
    echo(f"recognised of these trials: {before} before, {after} after, each by a build adapted to all others")
    if made.firmware:
        echo(f"firmware: {made.firmware}")
    else:
        where = shlex.quote(str(folder))
        echo(f'no firmware: pip install "thenar[compiler]", then thenar firmware {where} --target NAME -o firmware/')
