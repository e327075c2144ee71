"""`thenar compile`: recordings in, a build folder out."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from thenar.runtime.recipe import AUTO

from .options import (
    CHOOSING,
    LIMITS,
    LazyOption,
    TrainingCommand,
    asked_settings,
    fitted_hand,
    layout_option,
    parts_of,
    prices_of,
    prices_option,
    recipe_options,
    trainer_option,
    warn_of_budget,
)
from .parameters import (
    OneOf,
    OutputFile,
    OutputFolder,
    existing_file,
    jobs_option,
    keep_apart,
    overwrite_flag,
)
from .printing import json_flag, out, progress, show, warning

if TYPE_CHECKING:
    from thenar.compiler.artifact.documents import BuildReport
    from thenar.runtime.manifest import Manifest

_BOARD = "board"
# Options that a point of a frontier sets.
_SETTLED = ("sensors", "prune", "inputs", "table_bits", "placement", "keep", "width", "trainer", *LIMITS)
_GROUPS = {
    "Basics": ("output", "sensors", "placement", "keep", "levels", "keep_joints", "prune", "inputs"),
    "Limits": LIMITS,
    "Training": ("trainer", "robust", "refuse"),
    "Integer tables": ("table_bits", "width"),
    "The accuracies in build.json": ("folds", "seed", "by", "jobs"),
    "A point of a frontier": ("from_frontier", "point"),
    "Wiring": ("glove", "propose", "chip"),
    "Files": ("report", "layout", "overwrite", "json"),
}


def _chips() -> Iterable[str]:
    from thenar.drivers.i2c.chips import expanders

    return (*expanders(), _BOARD, *_converters())


def _converters() -> list[str]:
    """Return the kinds of chips that measure taxels."""
    from thenar.drivers.i2c.chips import CHIPS, expanders
    from thenar.drivers.spi.chips import SPI_CHIPS

    return [kind for kind in (*CHIPS, *SPI_CHIPS) if kind not in expanders()]


def _chips_help() -> str:
    measuring = _converters()
    chips = [kind for kind in _chips() if kind != _BOARD and kind not in measuring]
    return (
        f"Port expander to propose: {', '.join(chips)}; {_BOARD} for one that prints rows; or a converter for "
        f"taxels: {', '.join(measuring)}.  [default: {chips[0]}, and ads7828 for taxels]"
    )


@click.command("compile", cls=TrainingCommand, groups=_GROUPS)
@click.argument("recordings", metavar="SET.grasps", type=existing_file)
@click.option(
    "-o", "--output", type=OutputFolder(), required=True, help="Build folder to write; an existing build is replaced."
)
@recipe_options(*CHOOSING, "inputs")
@trainer_option(AUTO)
@recipe_options("refuse", "folds", "seed", "by")
@jobs_option()
@recipe_options("table_bits", "width")
@click.option("--from", "from_frontier", type=existing_file, help="A frontier.json: build one of its points.")
@click.option("--point", type=click.IntRange(1), help="Number of the point.  [default: the picked one]")
@click.option("--report/--no-report", default=True, show_default=True, help="Also write report.html and spec/.")
@layout_option
@prices_option
@click.option("--glove", type=existing_file, help="A glove.toml: add the scan map of its wiring to the build.")
@click.option("--propose", type=OutputFile(".toml"), help="Write a glove.toml that wires the kept switches.")
@click.option("--chip", type=OneOf("chip", _chips), cls=LazyOption, describe=_chips_help)
@overwrite_flag
@json_flag
@click.pass_context
def command(
    context: click.Context,
    /,
    recordings: Path,
    output: Path,
    from_frontier: Path | None,
    point: int | None,
    report: bool,
    jobs: int,
    layout: Path | None,
    prices: Path | None,
    glove: Path | None,
    propose: Path | None,
    chip: str | None,
    **asked: Any,
) -> None:
    """Choose the switches of SET.grasps, train on them, and write the build: integer tables and their verification.

    The folder holds build.json, tables.bin and ensemble.bin, the classifier in C in firmware/, the switch positions in
    hand.json, and with --glove scan.json. report.html shows all of it in a browser, where you also close switches and
    bend joints and see the prediction; spec/ describes the reduced glove to cut, solder and run. The same recordings,
    options, wiring and layout give the same bytes.

    \b
    Example:
        thenar compile set.grasps -o build/
        thenar compile set.grasps -o build/ --sensors 8
        thenar compile set.grasps -o build/ --method elimination --keep 39 --robust
        thenar compile set.grasps -o build/ --method elimination --keep 16 --never palm_heel_6 --apart-mm 8
        thenar compile set.grasps -o build/ --glove glove.toml
        thenar compile set.grasps -o build/ --from frontier/frontier.json --point 7
    """
    from thenar.compiler.artifact.compile import compile_build
    from thenar.compiler.artifact.documents import Documents
    from thenar.compiler.frontier.picked import picked
    from thenar.compiler.placement.ports import ports_of_whole_glove
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.harness.loading import load_harness

    _check(context, from_frontier, point)
    keep_apart(recordings, layout, prices, glove, propose, from_frontier)
    options = asked_settings(context, asked) | asked
    given = None if glove is None else load_harness(glove)
    grasp_set = GraspSet.load(recordings)
    hand = fitted_hand(layout, grasp_set.element_names, None)
    chosen = None if from_frontier is None else picked(from_frontier, point, grasp_set)
    options |= {"prices": prices_of(grasp_set, prices)} | ({} if chosen is None else chosen.options)
    marks: dict[str, Any] = {} if chosen is None else {"frontier": chosen.frontier, "point": chosen.point.number}
    marks["parts"] = parts_of(grasp_set, prices)
    with progress("compiling") as report_done:
        made = compile_build(
            grasp_set,
            output,
            harness=given if chosen is None else chosen.wired(given),
            ports=ports_of_whole_glove(given, grasp_set.element_names, len(grasp_set.taxel_columns)),
            hand=hand,
            documents=Documents(hand, **marks) if report else None,
            jobs=jobs,
            progress=report_done,
            **options,
        )
    warn_of_budget(asked["budget_us"], grasp_set.joint_names, None if given is None else given.cyberglove)
    for sentence in made.warnings:
        warning(sentence)
    if chosen is not None and given is not None and made.harness != given:
        warning(
            f"the scan map uses the wiring that point {chosen.point.number} was found with, not {glove}: to run on "
            "that glove, build a point that is read as wired, or compile without --from"
        )
    _propose(made.manifest, propose, chip)
    show(made.manifest, lambda _: _print(made, output, propose))


def _check(context: click.Context, from_frontier: Path | None, point: int | None) -> None:
    """Raise UsageError for options that conflict, before the training."""
    from thenar.compiler.trainers.base import TRAINERS

    given = context.params
    if given["chip"] is not None and given["propose"] is None:
        raise click.UsageError("--chip sets the chips of a proposed harness: add --propose with a file to write.")
    if given["propose"] is not None and given["glove"] is not None:
        raise click.UsageError("--glove reads a wiring and --propose writes a new one: give one of them.")
    if point is not None and from_frontier is None:
        raise click.UsageError("--point picks a point of a frontier: name its file with --from.")
    settings = (setting.name for trainer in TRAINERS.values() for setting in trainer.settings)
    for name in () if from_frontier is None else (*_SETTLED, *settings):
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = next(param.opts[-1] for param in context.command.get_params(context) if param.name == name)
            raise click.UsageError(f"{option} is set by the point that --from names: leave it out.")


def _propose(manifest: "Manifest", path: Path | None, chip: str | None) -> None:
    """Write a harness for the kept switches, if that was requested."""
    from thenar.compiler.glove.propose import propose_board, propose_cyberglove, propose_harness
    from thenar.runtime.files import write_atomically
    from thenar.runtime.harness.writing import harness_to_toml
    from thenar.runtime.names import sound_name

    if path is None:
        return
    chip = chip or next(iter(_chips()))
    names = [switch.name for switch in manifest.switches]
    called = sound_name(path.stem, "proposed")
    glove = propose_cyberglove([joint.name for joint in manifest.joints])
    if chip == _BOARD:
        harness = propose_board(names, name=called, cyberglove=glove)
    else:
        harness = propose_harness(names, chip, name=called, cyberglove=glove)
    write_atomically(path, harness_to_toml(harness).encode())


def _print(made: "BuildReport", folder: Path, propose: Path | None) -> None:
    console = out()
    for fact in made.facts:
        console.print(f"{folder}: {fact.text}" if fact.label == "build" else str(fact), soft_wrap=True)
    if propose is not None:
        console.print(
            f"{propose}: a harness for the kept switches; wire the glove so, then compile with --glove {propose}"
        )
