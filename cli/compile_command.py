"""`thenar compile`: recordings in, a build folder out."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from thenar.drivers.i2c.chips import CHIPS

from .common import any_path, existing_file, json_flag, out, output_file, print_json, progress, warning
from .compile_asked import TABLE_BITS, Asked
from .methods import WithMethods
from .scan_tables import print_scan

if TYPE_CHECKING:
    from thenar.compiler.artifact.compile import BuildReport
    from thenar.runtime.manifest import Manifest

_BOARD = "board"


@click.command("compile", cls=WithMethods)
@click.argument("recordings", metavar="SET.grasps", type=existing_file)
@click.option("-o", "--output", type=any_path, required=True, help="Folder of the build; a build there is replaced.")
@click.option(
    "--prune", type=click.IntRange(0), default=0, show_default=True, help="ID3 splits no fewer rows than this."
)
@click.option("--rounds", type=click.IntRange(1), default=100, show_default=True, help="Rounds of LogitBoost.")
@click.option(
    "--inputs",
    type=click.Choice(["both", "switches", "joints"]),
    default="both",
    show_default=True,
    help="What to use.",
)
@click.option("--shrinkage", type=float, default=1.0, show_default=True, help="Share of each round that is kept.")
@click.option("--tolerance", type=float, help="Stop after a round that changes the mean loss by less than this.")
@click.option("--folds", type=int, default=4, show_default=True, help="Folds of the rate in build.json; 0 for none.")
@click.option("--seed", type=int, default=1, show_default=True, help="Seed of the folds.")
@click.option(
    "--table-bits",
    type=click.Choice(list(TABLE_BITS)),
    default="16",
    show_default=True,
    help="8: coarser steps, so that firmware can store a byte an entry.",
)
@click.option(
    "--max-bins", type=click.IntRange(2), help="At most so many bins a joint: smaller tables.  [default: no limit]"
)
@click.option("--placement", default="id3", show_default=True, help="How switches are chosen: see below.")
@click.option("--keep", type=click.IntRange(1), help="How many switches, for placements that take a number.")
@click.option("--width", type=click.IntRange(4, 16), default=16, show_default=True, help="Bits that every sum fits.")
@click.option("--from", "from_frontier", type=existing_file, help="A frontier.json: build one of its points.")
@click.option("--point", type=click.IntRange(1), help="Which point of it.  [default: the one that it picked]")
@click.option("--report/--no-report", default=True, show_default=True, help="Write report.html and spec/ as well.")
@click.option("--hand-length", type=click.FloatRange(100, 300), help="Of whom the glove is for, mm.  [default: 190]")
@click.option("--glove", type=existing_file, help="A glove.toml: add the scan map of its wiring to the build.")
@click.option("--propose", type=output_file, help="Write a glove.toml for the kept switches: on the fewest ports.")
@click.option(
    "--chip",
    type=click.Choice([*CHIPS, _BOARD]),
    help="The port expander to propose, or a switch-scanner board.  [default: the first]",
)
@click.option("--overwrite", is_flag=True, help="Let --propose replace a file that is there.")
@json_flag
@click.pass_context
def command(context: click.Context, /, **options: Any) -> None:
    """Choose the switches, train, and write integer tables with their proof.

    The folder holds build.json, tables.bin and ensemble.bin, the classifier in C in firmware/, and with --glove
    scan.json; report.html tells all of it in a browser, spec/ is the reduced glove to cut, solder and run. The same
    recordings, options and wiring give the same bytes.

    \b
    Example:
        thenar compile set.grasps -o build/ --prune 13
        thenar compile set.grasps -o build/ --glove glove.toml
        thenar compile set.grasps -o build/ --from frontier/frontier.json --point 7
    """
    asked = Asked(**options)
    asked.check(context)
    made = _made(asked)
    if made.only_answer is not None:
        warning(
            f"the build recognises every row as {made.only_answer}: no input tells grasp types apart by "
            "itself, and stumps look at one at a time"
        )
    if asked.propose is not None:
        _propose(made.manifest, asked.propose, asked.chip or next(iter(CHIPS)))
    if asked.as_json:
        print_json(made.manifest)
        return
    _print(made, asked.output)
    if made.harness is not None and made.scan is not None:
        print_scan(made.scan, made.harness)
    if asked.propose is not None:
        out().print(
            f"{asked.propose}: a harness for the kept switches; wire the glove so, then compile with "
            f"--glove {asked.propose}"
        )


def _made(asked: Asked) -> "BuildReport":
    from thenar.compiler.artifact.compile import compile_build
    from thenar.compiler.artifact.documents import BuildDocuments
    from thenar.compiler.artifact.made import no_documents
    from thenar.compiler.placement.ports import ports_of_whole_glove
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.harness.loading import load_harness

    from .from_frontier import picked
    from .hand import hand_shape

    given = None if asked.glove is None else load_harness(asked.glove)
    grasp_set = GraspSet.load(asked.recordings)
    asked.check_hand(grasp_set.switch_names)
    chosen = None if asked.from_frontier is None else picked(asked.from_frontier, asked.point, grasp_set)
    with progress("compiling, then the paper's tables" if asked.report and asked.folds else "compiling") as told:
        documents = BuildDocuments(
            hand_shape(),
            asked.hand_length,
            None if chosen is None else chosen.frontier,
            None if chosen is None else chosen.point.number,
            told,
        )
        return compile_build(
            grasp_set,
            asked.output,
            **(asked.training if chosen is None else asked.training | chosen.options),
            harness=given if chosen is None else chosen.wired(given),
            ports=ports_of_whole_glove(given, grasp_set.switch_names),
            documents=documents if asked.report else no_documents,
            progress=told,
        )


def _propose(manifest: "Manifest", path: Path, chip: str) -> None:
    from thenar.runtime.files import write_atomically
    from thenar.runtime.harness.wiring import GloveWiring
    from thenar.runtime.harness.writing import harness_to_toml
    from thenar.runtime.names import sound_name
    from thenar.runtime.scanning.propose import propose_board, propose_harness

    names = [switch.name for switch in manifest.switches]
    called = sound_name(path.stem, "proposed")
    glove = GloveWiring(port="/dev/ttyUSB0") if manifest.joints else None
    if chip == _BOARD:
        harness = propose_board(names, name=called, cyberglove=glove)
    else:
        harness = propose_harness(names, chip, name=called, cyberglove=glove)
    write_atomically(path, harness_to_toml(harness).encode())


def _print(made: "BuildReport", folder: Path) -> None:
    manifest, proof = made.manifest, made.manifest.proof
    console = out()
    console.print(
        f"{folder}: {len(manifest.grasps)} grasp types from {len(manifest.switches)} of {manifest.source.switches} "
        f"switches and {len(manifest.joints)} joints; tables of {made.tables_bytes} bytes"
    )
    if manifest.switches:
        console.print(f"switches: {', '.join(switch.name for switch in manifest.switches)}", soft_wrap=True)
    if manifest.stopped_after:
        console.print(
            f"stopped after {manifest.stopped_after} of {manifest.options.rounds} rounds: the last changed the mean "
            f"loss by less than {manifest.options.tolerance:g}"
        )
    if manifest.zero_gain_nodes:
        console.print(
            f"at {manifest.zero_gain_nodes} of the placement's decisions no switch gains anything alone: "
            "the lowest-numbered one that varies was taken"
        )
    for rate in manifest.rates:
        how = "on the rows trained on" if rate.protocol == "training" else f"in {rate.folds} folds, placement and all"
        console.print(f"recognised {how}: {rate.correct} of {rate.total} ({rate.rate:.1%})")
    console.print(
        f"integers: {proof.scale:.1f} steps a unit, no sum beyond {proof.bound} of 32767, no score off by more than "
        f"{proof.error:g} steps; {proof.covered} of {manifest.source.rows} rows are safe, {proof.changed} change class"
    )
    console.print(made.firmware, soft_wrap=True)
