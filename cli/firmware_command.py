"""`thenar firmware`: write a build as C99 for a microcontroller."""

import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.table import Table

from .common import (
    OneOf,
    OutputFolder,
    existing_file,
    existing_folder,
    json_flag,
    out,
    print_json,
    progress,
    table,
    wants_json,
)

if TYPE_CHECKING:
    from thenar.compiler.firmware.choose import Fit
    from thenar.compiler.firmware.generate import Firmware
    from thenar.compiler.firmware.measuring import Measured
    from thenar.compiler.firmware.sensors import Sensors
    from thenar.compiler.firmware.targets import Target
    from thenar.compiler.firmware.targets.base import Mode
    from thenar.runtime.build import Build


def _targets() -> Iterable[str]:
    from thenar.compiler.firmware.targets import TARGETS

    return TARGETS


def _modes() -> Iterable[str]:
    from thenar.compiler.firmware.targets import TARGETS

    return dict.fromkeys(mode for target in TARGETS.values() for mode in target.modes)


_ANY = " Use `generic` for any other part with a C99 compiler."


class _Command(click.Command):
    """The command; its help ends with a description of each target."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from thenar.compiler.firmware.targets import TARGETS

        with formatter.section("Targets"):
            formatter.write_dl([(name, target.help) for name, target in TARGETS.items()])


@click.command("firmware", cls=_Command)
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.option(
    "--target", type=OneOf("target", _targets, _ANY), required=True, help="Target of the firmware: see below."
)
@click.option("-o", "--output", metavar="DIR", type=OutputFolder(), help="Folder to write the firmware into.")
@click.option(
    "--mode",
    type=OneOf("mode", _modes),
    default="classify",
    show_default=True,
    help="A library that classifies frames; a board that scans switches; or a glove that scans and classifies.",
)
@click.option("--board", metavar="board.toml", type=existing_file, help="Wiring of the microcontroller.")
@click.option(
    "--calibration",
    metavar="HAND.toml",
    type=existing_file,
    help="The wearer's calibration of the CyberGlove's bytes, from `thenar calibrate`.",
)
@click.option(
    "--glove",
    metavar="glove.toml",
    type=existing_file,
    help="The glove whose readings a library converts: the ranges of its streams, its calibrations.",
)
@click.option(
    "--name",
    default="glove",
    show_default=True,
    help="Name of files and functions, thenar_NAME: a to z, digits and _, at most 32.",
)
@click.option(
    "--flash-limit",
    type=click.IntRange(1),
    metavar="BYTES",
    help="Flash available to the classifier.  [default: half of the part's, three quarters if half is too little; "
    "on an AVR at most 48 KiB]",
)
@click.option("--frontier", is_flag=True, help="List the possible layouts: cycles against flash against width.")
@click.option(
    "--measure",
    is_flag=True,
    help="Compile, run the worst frame in a simulator, and record the cycles in the header.",
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
    glove: Path | None,
    name: str,
    flash_limit: int | None,
    frontier: bool,
    measure: bool,
    overwrite: bool,
) -> int:
    """Write C99 that predicts exactly as BUILD does, bit for bit, with a Makefile, or as a package for Arduino,
    PlatformIO, ESP-IDF, Zephyr, pico-sdk and CMake.

    A cost model chooses the layout of the tables: the fastest that fits. Exits with 1 if --measure exceeds the model's
    bounds. The same build and options give the same bytes.

    \b
    Example:
        thenar firmware build/ --target avr328p -o firmware/ --measure
        thenar firmware build/ --target avr2560 --mode glove --board board.toml -o firmware/
        thenar firmware build/ --target esp32 -o components/thenar_glove
        thenar firmware build/ --target avr328p --frontier
    """
    from thenar.compiler.firmware.board import load_board
    from thenar.compiler.firmware.generate import Firmware, write_folder
    from thenar.compiler.firmware.measuring import measure as measured_of
    from thenar.compiler.firmware.targets import TARGETS
    from thenar.runtime.build import Build

    _check(TARGETS[target], mode, writes=output is not None, counts=measure or frontier)
    _check_calibrated(mode, calibration, glove)
    loaded, sensors = _converting(Build.load(build), mode, calibration, glove)
    wiring = None if board is None else load_board(board)
    firmware = Firmware(loaded.tables, loaded.manifest, target, mode, name, wiring, flash_limit, loaded.scan, sensors)
    with progress("choosing a layout"):
        fit = firmware.fit
    measured = None
    if measure:
        with progress(f"measuring on {fit.target.part}"):
            measured = measured_of(firmware.library(), fit)
    files = firmware.files(None if measured is None else fit.notes(measured.note))
    if output is not None:
        write_folder(files, output, overwrite=overwrite)
    if wants_json():
        print_json(_document(fit, measured, sorted(files)))
    else:
        if mode != "scan":
            _print(fit, measured, frontier=frontier, updates=mode == "glove")
        _print_firmware(firmware, target, output)
    return 0 if measured is None or measured.holds else 1


def _converting(
    build: "Build", mode: "Mode", calibration: Path | None, glove: Path | None
) -> "tuple[Build, Sensors | None]":
    """Return the build, and how a library converts raw readings to its codes, if a calibration is known. A glove's
    firmware takes no conversion: its build is for the bytes of the calibrated hand.
    """
    from thenar.compiler.firmware.one_hand import for_one_hand
    from thenar.compiler.firmware.sensors import sensors_of
    from thenar.runtime.calibration import load_calibration
    from thenar.runtime.harness.loading import load_harness

    hand = None if calibration is None else load_calibration(calibration)
    if mode == "classify" and (hand or glove):
        return build, sensors_of(build.manifest, None if glove is None else load_harness(glove), hand)
    return build if hand is None else for_one_hand(build, hand), None


def _check_calibrated(mode: "Mode", calibration: Path | None, glove: Path | None) -> None:
    """Raise UsageError if a mode takes no calibration, or if two are given."""
    if calibration is not None and mode == "scan":
        raise click.UsageError(
            "--calibration is for the modes classify and glove: a scanning board reads no CyberGlove, so leave it out."
        )
    if glove is not None and mode != "classify":
        raise click.UsageError("--glove is for --mode classify: describe a board's wiring with --board.")
    if glove is not None and calibration is not None:
        raise click.UsageError("glove.toml names its calibration: leave out --calibration, or --glove.")


def _check(target: "Target", mode: "Mode", *, writes: bool, counts: bool) -> None:
    """Raise UsageError for options that conflict; `counts` is --measure or --frontier."""
    if mode == "scan" and counts:
        raise click.UsageError("A board that only scans has no classifier: leave out --measure and --frontier.")
    if not target.own_layout and not target.any_part and counts:
        raise click.UsageError("The host has no cycle counts: --measure and --frontier are for microcontrollers.")
    if not writes and not counts:
        raise click.UsageError("Nothing to do: name a folder to write with -o, or add --frontier or --measure.")


def _print(fit: "Fit", measured: "Measured | None", *, frontier: bool, updates: bool) -> None:
    console = out()
    if frontier:
        console.print(_frontier_table(fit))
    console.print(f"layout {fit.words}", soft_wrap=True)
    if fit.target.own_layout:
        console.print(f"expected: {_expected(fit, updates)}", soft_wrap=True)
    if measured is not None:
        console.print(measured.note, soft_wrap=True)
        console.print("within the bounds" if measured.holds else "BEYOND THE BOUNDS")


def _print_firmware(firmware: "Firmware", target: str, output: Path | None) -> None:
    """Print what the firmware does with segments and, if it was written, what to do with it."""
    from thenar.compiler.firmware.targets import TARGETS

    if firmware.segments:
        out().print(f"{firmware.segments}.", soft_wrap=True)
    if output is None:
        return
    if firmware.mode == "classify" and (said := TARGETS[target].said(firmware.library())):
        out().print(f"{said}.", soft_wrap=True)
    next_step = TARGETS[target].next_step.format(folder=shlex.quote(str(output)))
    out().print(f"{output}: firmware for {target}; {next_step}", soft_wrap=True)


def _expected(fit: "Fit", updates: bool) -> str:
    cost = fit.choice.cost
    less = "" if updates else f" ({cost.flash_classify} if only classify() is called)"
    times = f"{cost.cycles} {fit.target.unit} a frame ({cost.update_cycles} by update())"
    return f"{fit.target.bound} {times}, {cost.flash} bytes of flash{less}, {cost.ram} of RAM"


def _layouts(fit: "Fit") -> list[dict[str, Any]]:
    """Return the frontier that the layout was chosen from, fastest first: `time` of a frame, bytes, and how many
    switches, and joints, share a `lookup` at most.
    """
    return [
        {
            "entry_bits": layout.entry_bits,
            "lookup": max(map(len, layout.groups), default=0),
            "joints": max((len(lookup.joints) for lookup in layout.lookups), default=0),
            "bins": layout.bins if layout.joints else "",
            "adding": layout.adding if fit.target.avr else "",
            "time": cost.cycles,
            "flash": cost.flash,
            "ram": cost.ram,
            "chosen": layout is fit.choice.layout,
        }
        for layout, cost in fit.choice.frontier
    ]


def _frontier_table(fit: "Fit") -> Table:
    """Return the frontier as a table, with the chosen layout marked."""
    numbers = ("bits", "switches per lookup", "joints", fit.target.unit, "flash", "RAM")
    columns = ("", *numbers[:3], "codes", "rows added", *numbers[3:])
    layouts = table(columns, numbers, f"Layouts for {fit.target.part}, {fit.target.bound}")
    for row in _layouts(fit):
        mark, shared = "*" if row["chosen"] else "", [str(row[key] or "") for key in ("lookup", "joints")]
        costs = (str(row[key]) for key in ("time", "flash", "ram"))
        layouts.add_row(mark, str(row["entry_bits"]), *shared, row["bins"], row["adding"], *costs)
    return layouts


def _document(fit: "Fit", measured: "Measured | None", files: list[str]) -> dict[str, object]:
    """Return the document of --json; the host target has no cycle counts and so no cost."""
    counted, cost = fit.target.own_layout, fit.choice.cost
    costs = {
        "time": cost.cycles,
        "unit": fit.target.unit,
        "flash": cost.flash,
        "flash_classify": cost.flash_classify,
        "ram": cost.ram,
        "bound": fit.target.avr,
    }
    return {
        "part": fit.target.part,
        "layout": fit.words,
        "cost": costs if counted else None,
        "frontier": _layouts(fit) if counted else [],
        "measured": measured,
        "files": files,
    }
