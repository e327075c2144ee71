"""`thenar spec`: specify the reduced glove of a build, ready to cut, sew, solder and run."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import fitted_hand, layout_option, prices_option
from .parameters import Number, OutputFolder, existing_file, existing_folder
from .printing import json_flag, out, show, table

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thenar.compiler.glove.spec import SpecSummary
    from thenar.runtime.harness.wiring import Harness

_FOLDER = "spec"
_WIRING = "glove.toml"


@click.command("spec")
@click.argument("build", type=existing_folder)
@click.option("--hand-length", type=Number(100, 300), metavar="MM", help="Length from wrist to middle fingertip.")
@layout_option
@prices_option
@click.option("--glove", type=existing_file, help="The glove.toml of its wiring.  [default: propose a new one]")
@click.option(
    "-o", "--output", type=OutputFolder(), help="Also write the files to this folder, replacing a spec there."
)
@json_flag
def command(
    build: Path,
    hand_length: float | None,
    layout: Path | None,
    prices: Path | None,
    glove: Path | None,
    output: Path | None,
) -> None:
    """Specify the reduced glove of a BUILD: switch positions, wiring, parts to buy, and expected performance.

    The files are the pattern at 1:1, lists of switches, wires and materials, a netlist for KiCad, and
    glove.toml.

    \b
    Example:
        thenar spec build/
        thenar spec build/ --hand-length 182 --glove glove.toml -o spec/
        thenar spec build/ --layout layout.toml -o spec/
    """
    from thenar.compiler.glove.files import check_output, expectations, files_of, write_spec
    from thenar.compiler.glove.prices import load_prices
    from thenar.compiler.glove.spec import glove_spec
    from thenar.compiler.scan_file import load_scan
    from thenar.runtime.build import Build

    loaded = Build.load(build)
    if output is not None:
        check_output(output)
    sensors = list(dict.fromkeys(switch.source for switch in loaded.manifest.switches))
    hand = fitted_hand(layout, sensors, hand_length)
    every = [*sensors, *(joint.name for joint in loaded.manifest.joints)]
    parts = {} if prices is None else load_prices(prices, every)
    scan = load_scan(build, loaded.manifest)
    spec = glove_spec(loaded.manifest, scan, _harness(build, scan is not None, glove), hand, parts)
    written = None
    if output is not None:
        files = files_of(spec)
        write_spec(files, output)
        written = f"{output}: {', '.join(sorted(files))}"
    show(spec.summary, lambda summary: _print(summary, expectations(spec), written))


def _harness(folder: Path, wired: bool, glove: Path | None) -> "Harness | None":
    """Return the named wiring, or the one in a build that was compiled for one; None for a new one."""
    from thenar.runtime.harness.loading import load_harness

    if glove is not None:
        return load_harness(glove)
    own = folder / _FOLDER / _WIRING
    return load_harness(own) if wired and own.is_file() else None


def _print(spec: "SpecSummary", expected: "Iterable[str]", written: str | None) -> None:
    """Print the content of `spec.json` for people, and the names of the written files."""
    from thenar.compiler.glove.layout import counted_sensors

    console = out()
    hand = "" if spec.hand_length_mm is None else f", for a right hand of {spec.hand_length_mm:g} mm"
    wired = "a proposed wiring" if spec.proposed else f"wired as {spec.glove}"
    console.print(f"{spec.kept}; {wired}{hand}")
    pins = {
        n: f"{reader.ref} {pin}" for reader in spec.readers for n, pin in zip(reader.switches, reader.pins, strict=True)
    }
    sensors = table(("sensor", "name", "part", "side", "x, mm", "y, mm", "read by"), title="Sensors")
    for sensor in spec.sensors:
        place = ("" if mm is None else f"{mm:.1f}" for mm in (sensor.x_mm, sensor.y_mm))
        sensors.add_row(sensor.ref, sensor.name, sensor.part or "", sensor.side or "", *place, pins[sensor.number])
    console.print(sensors)
    for reader in spec.readers:
        words = counted_sensors([spec.sensors[number - 1] for number in reader.switches])
        console.print(f"{reader.ref}: {reader.place}, {words}")
    materials = table(("quantity", "what", "part number", "note", "price"), title="Materials")
    for line in spec.materials:
        part = line.part if line.sure else f"{line.part} (not confirmed)"
        price = "" if line.price is None else f"{line.quantity * line.price:.2f}"
        materials.add_row(f"{line.quantity:g} {line.unit}", line.what, part, line.note, price)
    console.print(materials)
    if spec.print_on:
        console.print(f"the pattern is for {spec.print_on}")
    for sentence in (*expected, *spec.remarks):
        console.print(sentence)
    if written is not None:
        console.print(written, soft_wrap=True)
