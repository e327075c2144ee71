"""`thenar firmware`: write a build as C99 for a microcontroller, or a sketch for a board that prints rows."""

import shlex
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import Described
from .parameters import OneOf, OutputFolder, existing_file, existing_folder
from .printing import echo, json_flag, progress, show

if TYPE_CHECKING:
    from thenar.compiler.firmware.costs import Measured, PartFit
    from thenar.compiler.firmware.targets import Target


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
    "--glove",
    metavar="glove.toml",
    type=existing_file,
    help="The glove whose readings a library converts, with its calibrations; or whose [stream.board] a sketch reads.",
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
    from thenar.compiler.firmware.classifier import Library
    from thenar.compiler.firmware.costs import fit_for
    from thenar.compiler.firmware.costs import measure as measured_of
    from thenar.compiler.firmware.generate import write_folder
    from thenar.compiler.firmware.sensors import sensors_of
    from thenar.compiler.firmware.targets import TARGETS
    from thenar.runtime.build import Build
    from thenar.runtime.harness.loading import load_harness

    if mode == "rows":
        libraries = {"target": target, "flash-limit": flash_limit, "measure": measure}
        if given := [option for option, value in libraries.items() if value]:
            raise click.UsageError(f"--{given[0]} is for libraries, not for sketches that print rows: leave it out.")
        return _write_sketches(build, glove, output, name, overwrite=overwrite)
    if target is None:
        raise click.UsageError("A library needs a target: name one with --target.")
    if TARGETS[target].kind == "host" and measure:
        raise click.UsageError("The host has no cycle counts: --measure is for microcontrollers.")
    if output is None and not measure:
        raise click.UsageError("Nothing to do: name a folder to write with -o, or add --measure.")
    loaded = Build.load(build)
    sensors = None if glove is None else sensors_of(loaded.manifest, load_harness(glove))
    member = TARGETS[target]
    fit = fit_for(member, loaded.tables, flash_limit)
    library = Library(name, loaded.manifest, fit.layout, fit.notes(), sensors)
    measured = None
    if measure:
        with progress(f"measuring on {fit.target.part}"):
            measured = measured_of(library, fit)
        library = replace(library, notes=fit.notes(measured.note))
    files = member.files(library)
    if output is not None:
        write_folder(files, output, overwrite=overwrite)
    # The host has no cycle counts and so no cost.
    cost = fit.cost
    costs = cost and {"time": cost.cycles, "unit": fit.target.unit, "flash": cost.flash, "ram": cost.ram}
    document = {"part": fit.target.part, "cost": costs, "measured": measured}
    show(document | {"files": sorted(files)}, lambda _: _print(member, fit, measured, output))
    return 0


def _write_sketches(build: Path, glove: Path | None, output: Path | None, name: str, *, overwrite: bool) -> int:
    from thenar.compiler.firmware.generate import write_folder
    from thenar.compiler.firmware.rows import rows_files
    from thenar.runtime.build import Build
    from thenar.runtime.harness.loading import load_harness

    if glove is None or output is None:
        raise click.UsageError("A sketch needs the glove's wiring and a folder: name them with --glove and -o.")
    files = rows_files(name, Build.load(build).manifest, load_harness(glove))
    write_folder(files, output, overwrite=overwrite)
    readme = shlex.quote(str(output / "README.md"))
    line = f"{output}: a sketch for Arduino's cores; {readme} explains how to compile it"
    show({"files": sorted(files)}, lambda _: echo(line))
    return 0


def _print(target: "Target", fit: "PartFit", measured: "Measured | None", output: Path | None) -> None:
    if fit.cost is not None:
        echo(f"cost {fit.words}")
    if measured is not None:
        echo(measured.note)
    if output is not None:
        next_step = target.next_step.format(folder=shlex.quote(str(output)))
        echo(f"{output}: firmware for {target.name}; {next_step}")
