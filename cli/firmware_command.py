"""`thenar firmware`: write a build as C99 for a microcontroller, or a sketch for a board that prints rows."""

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
from .options import Described

if TYPE_CHECKING:
    from thenar.compiler.firmware.choose import Fit
    from thenar.compiler.firmware.generate import Firmware
    from thenar.compiler.firmware.measuring import Measured
    from thenar.compiler.firmware.sensors import Sensors
    from thenar.runtime.build import Build


def _targets() -> Iterable[str]:
    from thenar.compiler.firmware.targets import TARGETS

    return TARGETS


_ANY = " Use `generic` for any other part with a C99 compiler."


def _described() -> dict[str, list[tuple[str, str]]]:
    from thenar.compiler.firmware.targets import TARGETS

    return {"Targets": [(name, target.help) for name, target in TARGETS.items()]}


@click.command("firmware", cls=Described, sections=_described)
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.option("--target", type=OneOf("target", _targets, _ANY), help="Target of the library: see below.")
@click.option("-o", "--output", metavar="DIR", type=OutputFolder(), help="Folder to write the firmware into.")
@click.option(
    "--mode",
    type=click.Choice(["classify", "rows"]),
    default="classify",
    show_default=True,
    help="A library that classifies frames; or an Arduino sketch for a board that prints the rows of a stream.",
)
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
    help="The glove whose readings a library converts, or whose [stream.board] a sketch reads.",
)
@click.option(
    "--name",
    default="glove",
    show_default=True,
    help="Name of the tables, thenar_NAME, or of the sketch: a to z, digits and _, at most 32.",
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
    target: str | None,
    output: Path | None,
    mode: str,
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
        thenar firmware build/ --target esp32 -o components/thenar_glove
        thenar firmware build/ --mode rows --glove glove.toml -o board/
    """
    from thenar.compiler.firmware.generate import Firmware, write_folder
    from thenar.compiler.firmware.measuring import measure as measured_of
    from thenar.runtime.build import Build

    if mode == "rows":
        _check_rows(**{"target": target, "calibration": calibration, "flash-limit": flash_limit, "measure": measure})
        return _write_sketches(build, glove, output, name, overwrite=overwrite)
    if target is None:
        raise click.UsageError("A library needs a target: name one with --target.")
    _check(target, writes=output is not None, measures=measure)
    if glove is not None and calibration is not None:
        raise click.UsageError("glove.toml names its calibration: leave out --calibration, or --glove.")
    loaded = Build.load(build)
    sensors = _sensors(loaded, calibration, glove)
    firmware = Firmware(loaded.tables, loaded.manifest, target, name, flash_limit, sensors)
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
        _print(fit, measured)
        if output is not None:
            _print_next_step(firmware, target, output)
    return 0


def _check_rows(**options: object) -> None:
    """Raise UsageError if an option was given that is for libraries."""
    if given := [option for option, value in options.items() if value]:
        raise click.UsageError(f"--{given[0]} is for libraries, not for sketches that print rows: leave it out.")


def _write_sketches(build: Path, glove: Path | None, output: Path | None, name: str, *, overwrite: bool) -> int:
    from thenar.compiler.firmware.generate import write_folder
    from thenar.compiler.firmware.rows import rows_files
    from thenar.runtime.build import Build
    from thenar.runtime.harness.loading import load_harness

    if glove is None or output is None:
        raise click.UsageError(
            "A sketch needs the glove's wiring and a folder to write: name them with --glove and -o."
        )
    files = rows_files(name, Build.load(build).manifest, load_harness(glove))
    write_folder(files, output, overwrite=overwrite)
    if wants_json():
        print_json({"files": sorted(files)})
    else:
        readme = shlex.quote(str(output / "README.md"))
        out().print(f"{output}: a sketch for Arduino's cores; {readme} explains how to compile it", soft_wrap=True)
    return 0


def _sensors(build: "Build", calibration: Path | None, glove: Path | None) -> "Sensors | None":
    """Return how a library converts raw readings to its codes, if a calibration or a glove is known."""
    from thenar.compiler.firmware.sensors import sensors_of
    from thenar.runtime.calibration import load_calibration
    from thenar.runtime.harness.loading import load_harness

    hand = None if calibration is None else load_calibration(calibration)
    if glove is None and hand is None:
        return None
    return sensors_of(build.manifest, None if glove is None else load_harness(glove), hand)


def _check(target: str, *, writes: bool, measures: bool) -> None:
    """Raise UsageError for options that conflict."""
    from thenar.compiler.firmware.targets import TARGETS

    if TARGETS[target].kind == "host" and measures:
        raise click.UsageError("The host has no cycle counts: --measure is for microcontrollers.")
    if not writes and not measures:
        raise click.UsageError("Nothing to do: name a folder to write with -o, or add --measure.")


def _print(fit: "Fit", measured: "Measured | None") -> None:
    console = out()
    console.print(f"layout {fit.words}", soft_wrap=True)
    if measured is not None:
        console.print(measured.note, soft_wrap=True)


def _print_next_step(firmware: "Firmware", target: str, output: Path) -> None:
    from thenar.compiler.firmware.targets import TARGETS

    if said := TARGETS[target].said(firmware.library()):
        out().print(f"{said}.", soft_wrap=True)
    next_step = TARGETS[target].next_step.format(folder=shlex.quote(str(output)))
    out().print(f"{output}: firmware for {target}; {next_step}", soft_wrap=True)


def _document(fit: "Fit", measured: "Measured | None", files: list[str]) -> dict[str, object]:
    """Return the document of --json; the host target has no cycle counts and so no cost."""
    cost = fit.cost
    costs = cost and {"time": cost.cycles, "unit": fit.target.unit, "flash": cost.flash, "ram": cost.ram}
    return {"part": fit.target.part, "layout": fit.words, "cost": costs, "measured": measured, "files": files}
