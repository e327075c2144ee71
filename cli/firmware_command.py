"""`thenar firmware`: a build as C99 for a microcontroller."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import any_path, existing_file, existing_folder, json_flag, out, print_json, progress

if TYPE_CHECKING:
    from thenar.compiler.firmware.generate import Mode, Request
    from thenar.compiler.firmware.library import Fit
    from thenar.compiler.firmware.measuring import Measured

# Spelled out so that --help imports nothing; tests hold them against the compiler's own.
PLATFORMS = ("avr328p", "avr2560", "cortex-m0plus", "cortex-m4", "host", "arduino")
MODES = ("classify", "scan", "glove")


@click.command("firmware")
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.option("--target", type=click.Choice(PLATFORMS), required=True, help="What the firmware is for.")
@click.option("-o", "--output", metavar="DIR", type=any_path, help="Folder to write the firmware into.")
@click.option(
    "--mode",
    type=click.Choice(MODES),
    default="classify",
    show_default=True,
    help="A library that classifies frames; a board that scans switches; or one that also recognises.",
)
@click.option("--board", metavar="board.toml", type=existing_file, help="How the microcontroller is wired.")
@click.option(
    "--calibration",
    metavar="HAND.toml",
    type=existing_file,
    help="The hand that a glove firmware is for: its CyberGlove's bytes, from `thenar calibrate`.",
)
@click.option(
    "--name",
    default="glove",
    show_default=True,
    help="What files and functions are called, thenar_NAME: a to z, digits and _, at most 32.",
)
@click.option(
    "--flash-limit",
    type=click.IntRange(1),
    metavar="BYTES",
    help="Flash that the classifier may take.  [default: half of the part's, three quarters where half is too little; "
    "on an AVR at most 48 KiB]",
)
@click.option("--frontier", is_flag=True, help="Show the layouts there are: cycles against flash against width.")
@click.option(
    "--measure",
    is_flag=True,
    help="Compile, run the worst frame in a simulator, and note in the header what it took.",
)
@click.option("--overwrite", is_flag=True, help="Replace firmware that thenar wrote there; other files stay.")
@json_flag
def command(
    build: Path,
    target: str,
    output: Path | None,
    mode: "Mode",
    board: Path | None,
    calibration: Path | None,
    name: str,
    flash_limit: int | None,
    frontier: bool,
    measure: bool,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Write C99 that recognises as BUILD does, bit for bit, with a Makefile, or as an Arduino library.

    The layout of the tables is chosen by a cost model: the fastest that fits. Exits with 1 if --measure finds more
    than the model allows for. The same build and options give the same bytes.

    \b
    Example:
        thenar firmware build/ --target avr328p -o firmware/ --measure
        thenar firmware build/ --target avr2560 --mode glove --board board.toml -o firmware/
        thenar firmware build/ --target avr328p --frontier
    """
    from thenar.compiler.firmware.board_loading import load_board
    from thenar.compiler.firmware.folder import write_folder
    from thenar.compiler.firmware.generate import Request, firmware_files, fit_of
    from thenar.compiler.firmware.one_hand import for_one_hand
    from thenar.runtime.build import Build
    from thenar.runtime.calibration import load_calibration

    _check(target, mode, writes=output is not None, counts=measure or frontier, calibrated=calibration is not None)
    loaded = Build.load(build)
    if calibration is not None:
        loaded = for_one_hand(loaded, load_calibration(calibration))
    wiring = None if board is None else load_board(board)
    request = Request(loaded, target, mode, name, wiring, flash_limit)
    with progress("choosing a layout"):
        fit = fit_of(request)
    measured = _measured(request, fit) if measure else None
    files = firmware_files(request, fit, fit.notes() if measured is None else fit.notes(measured.note))
    if output is not None:
        write_folder(files, output, overwrite=overwrite)
    if as_json:
        print_json(_told(fit, measured, sorted(files)))
    else:
        if mode != "scan":
            _print(fit, measured, frontier=frontier, updates=mode == "glove")
        if output is not None:
            out().print(f"{output}: firmware for {target}; {_next_step(target, output)}", soft_wrap=True)
    return 0 if measured is None or measured.holds else 1


def _check(target: str, mode: "Mode", *, writes: bool, counts: bool, calibrated: bool) -> None:
    """Raise UsageError where options do not go together; `counts` is --measure or --frontier."""
    if mode == "scan" and counts:
        raise click.UsageError("A board that only scans holds no classifier to --measure or to see the --frontier of.")
    if target == "host" and counts:
        raise click.UsageError("On this machine nothing is counted: --measure and --frontier are for microcontrollers.")
    if not writes and not counts:
        raise click.UsageError("Name a folder to write with -o, or look first, with --frontier or --measure.")
    if calibrated and mode != "glove":
        raise click.UsageError("--calibration is for --mode glove: no other reads a CyberGlove.")


def _measured(request: "Request", fit: "Fit") -> "Measured":
    from thenar.compiler.firmware.generate import library
    from thenar.compiler.firmware.measuring import measure

    with progress(f"measuring on {fit.target.part}"):
        return measure(library(request, fit), request.name, fit, request.build.grasps)


def _next_step(target: str, folder: Path) -> str:
    if target == "arduino":
        return "put it into `libraries` of your sketchbook, or into `lib` of a PlatformIO project"
    make = f"make -C {shlex.quote(str(folder))}"
    return f"`{make}` compiles it" if target.startswith("avr") else f"`{make} check` compiles and tests it"


def _print(fit: "Fit", measured: "Measured | None", *, frontier: bool, updates: bool) -> None:
    from .firmware_tables import frontier_table

    console = out()
    if frontier:
        console.print(frontier_table(fit))
    console.print(f"layout {fit.words}", soft_wrap=True)
    if fit.target.kind != "host":
        console.print(f"expected: {_expected(fit, updates)}", soft_wrap=True)
    if measured is not None:
        console.print(measured.note, soft_wrap=True)
        if not measured.rough:
            console.print("within the bounds" if measured.holds else "BEYOND THE BOUNDS")


def _expected(fit: "Fit", updates: bool) -> str:
    cost = fit.choice.cost
    less = "" if updates else f" ({cost.flash_classify} where nothing calls update())"
    times = f"{cost.cycles} {fit.unit} a frame ({cost.update_cycles} by update())"
    return f"{fit.bound} {times}, {cost.flash} bytes of flash{less}, {cost.ram} of RAM"


def _told(fit: "Fit", measured: "Measured | None", files: list[str]) -> object:
    from .firmware_tables import Told, cost_told, layouts

    counted = fit.target.kind != "host"
    cost, frontier = (cost_told(fit), layouts(fit)) if counted else (None, [])
    return Told(fit.target.part, fit.words, cost, frontier, measured, files)
