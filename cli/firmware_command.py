"""`thenar firmware`: write a build as C99 for a microcontroller."""

import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import (
    OneOf,
    OutputFolder,
    existing_file,
    existing_folder,
    json_flag,
    out,
    print_json,
    progress,
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
    help="Flash available to the classifier.  [default: three quarters of the part's; on an AVR at most 48 KiB]",
)
@click.option(
    "--measure",
    is_flag=True,
    help="Compile, run slow frames in a simulator, and record the cycles in the header: for AVRs.",
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
    measure: bool,
    overwrite: bool,
) -> int:
    """Write C99 that predicts exactly as BUILD does, bit for bit, with a Makefile, or as a package for Arduino,
    PlatformIO, ESP-IDF, Zephyr, pico-sdk and CMake.

    What it costs is estimated, and a build that does not fit is refused. The same build and options give the same
    bytes.

    \b
    Example:
        thenar firmware build/ --target avr328p -o firmware/ --measure
        thenar firmware build/ --target avr2560 --mode glove --board board.toml -o firmware/
        thenar firmware build/ --target esp32 -o components/thenar_glove
    """
    from thenar.compiler.firmware.board import load_board
    from thenar.compiler.firmware.generate import Firmware, write_folder
    from thenar.compiler.firmware.measuring import measure as measured_of
    from thenar.compiler.firmware.targets import TARGETS
    from thenar.runtime.build import Build

    _check(TARGETS[target], mode, writes=output is not None, measures=measure)
    _check_calibrated(mode, calibration, glove)
    loaded, sensors = _converting(Build.load(build), mode, calibration, glove)
    wiring = None if board is None else load_board(board)
    firmware = Firmware(loaded.tables, loaded.manifest, target, mode, name, wiring, flash_limit, loaded.scan, sensors)
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
            _print(fit, measured)
        _print_firmware(firmware, target, output)
    return 0


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


def _check(target: "Target", mode: "Mode", *, writes: bool, measures: bool) -> None:
    """Raise UsageError for options that conflict."""
    if mode == "scan" and measures:
        raise click.UsageError("A board that only scans has no classifier: leave out --measure.")
    if target.kind == "host" and measures:
        raise click.UsageError("The host has no cycle counts: --measure is for microcontrollers.")
    if not writes and not measures:
        raise click.UsageError("Nothing to do: name a folder to write with -o, or add --measure.")


def _print(fit: "Fit", measured: "Measured | None") -> None:
    console = out()
    console.print(f"layout {fit.words}", soft_wrap=True)
    if measured is not None:
        console.print(measured.note, soft_wrap=True)


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


def _document(fit: "Fit", measured: "Measured | None", files: list[str]) -> dict[str, object]:
    """Return the document of --json; the host target has no cycle counts and so no cost."""
    cost = fit.cost
    costs = cost and {"time": cost.cycles, "unit": fit.target.unit, "flash": cost.flash, "ram": cost.ram}
    return {"part": fit.target.part, "layout": fit.words, "cost": costs, "measured": measured, "files": files}
