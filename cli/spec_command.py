"""`thenar spec`: specify the reduced glove of a build, ready to cut, sew, solder and run."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import Number, OutputFolder, existing_file, existing_folder, json_flag, out, show, table
from .options import fitted_hand, layout_option

if TYPE_CHECKING:
    from thenar.compiler.glove.layout import BoardPins
    from thenar.compiler.glove.spec import SpecSummary
    from thenar.runtime.build import Build
    from thenar.runtime.harness.wiring import Harness
    from thenar.runtime.manifest import Manifest

_FOLDER = "spec"
_WIRING = "glove.toml"


@click.command("spec")
@click.argument("build", type=existing_folder)
@click.option("--hand-length", type=Number(100, 300), metavar="MM", help="Length from wrist to middle fingertip.")
@layout_option
@click.option("--glove", type=existing_file, help="The glove.toml of its wiring.  [default: propose a new one]")
@click.option("--board", type=existing_file, help="The board.toml of the scanner board that reads the switches.")
@click.option(
    "-o", "--output", type=OutputFolder(), help="Also write the files to this folder, replacing a spec there."
)
@json_flag
def command(
    build: Path,
    hand_length: float | None,
    layout: Path | None,
    glove: Path | None,
    board: Path | None,
    output: Path | None,
) -> None:
    """Specify the reduced glove of a BUILD: switch positions, wiring, parts to buy, and expected performance.

    The files are the pattern at 1:1 as SVG and DXF, lists of switches, wires and materials, a netlist for KiCad, and
    glove.toml.

    \b
    Example:
        thenar spec build/
        thenar spec build/ --hand-length 182 --glove glove.toml -o spec/
        thenar spec build/ --layout layout.toml -o spec/
    """
    from thenar.compiler.glove.files import check_output, files_of, write_spec
    from thenar.compiler.glove.spec import glove_spec
    from thenar.runtime.build import Build

    loaded = Build.load(build)
    if output is not None:
        check_output(output)
    hand = fitted_hand(layout, list(dict.fromkeys(switch.source for switch in loaded.manifest.switches)), hand_length)
    pins = () if board is None else (_board_pins(board, loaded.manifest),)
    harness = _harness(build, loaded, glove, board)
    spec = glove_spec(loaded.manifest, loaded.scan, harness, hand, pins)
    written = ""
    if output is not None:
        files = files_of(spec)
        write_spec(files, output)
        written = f"{output}: {', '.join(sorted(files))}"
    show(spec.summary, _print, written)


def _harness(folder: Path, loaded: "Build", glove: Path | None, board: Path | None) -> "Harness | None":
    """Return the named wiring, the board's, or the one in the build; None for a new one."""
    from thenar.runtime.harness.loading import load_harness, parse_harness

    if glove is not None:
        return load_harness(glove)
    if board is not None:
        from thenar.compiler.firmware.board import glove_toml, load_board
        from thenar.runtime.names import sound_name

        name = sound_name(board.stem, "board")
        return parse_harness(glove_toml(name, load_board(board), loaded.manifest), name)
    own = folder / _FOLDER / _WIRING
    return load_harness(own) if loaded.scan is not None and own.is_file() else None


def _board_pins(path: Path, manifest: "Manifest") -> "BoardPins":
    """Return the pins by which the board of a `board.toml` reads its keys."""
    from dataclasses import replace

    from thenar.compiler.firmware.board import check_switches, key_names, keys_of, load_board
    from thenar.compiler.glove.layout import BoardPins
    from thenar.runtime.harness.wiring import BusWiring

    board = load_board(path)
    names = keys_of(board, manifest.switches)
    check_switches(board, names)
    taxels = board.taxels
    pins = BoardPins() if taxels is None else BoardPins(channels=taxels.inputs, selects=taxels.select)
    if board.chips:
        return replace(pins, bus=BusWiring(device=board.part, clock_hz=board.bus.clock_hz, chips=board.chips))
    if board.matrix is None:
        keys = tuple(board.pins[name] for name in key_names(board, names))
        return replace(pins, signals=keys, lows=("",) * len(keys))
    rows, columns = board.matrix.rows, board.matrix.columns
    lows = tuple(row for row in rows for _ in columns)
    return replace(pins, signals=columns * len(rows), lows=lows, diodes=board.matrix.diodes)


def _print(spec: "SpecSummary", written: str) -> None:
    """Print the content of `spec.json` for people, and the names of the written files."""
    from thenar.compiler.glove.lists import expectations

    console = out()
    hand = "" if spec.hand_length_mm is None else f", for a right hand of {spec.hand_length_mm:g} mm"
    wired = "a proposed wiring" if spec.proposed else f"wired as {spec.glove}"
    console.print(f"{spec.kept}; {wired}{hand}")
    _print_sensors(spec)
    _print_wires(spec)
    _print_materials(spec)
    if spec.print_on:
        console.print(f"the pattern is for {spec.print_on}")
    for sentence in (*expectations(spec.expected), *spec.remarks):
        console.print(sentence)
    if written:
        console.print(written, soft_wrap=True)


def _print_sensors(spec: "SpecSummary") -> None:
    from thenar.compiler.glove.layout import counted_sensors

    pins = {
        n: f"{reader.ref} {pin}" for reader in spec.readers for n, pin in zip(reader.switches, reader.pins, strict=True)
    }
    sensors = table(("sensor", "name", "part", "side", "x, mm", "y, mm", "read by"), title="Sensors")
    for sensor in spec.sensors:
        place = ("", "") if sensor.x_mm is None or sensor.y_mm is None else (f"{sensor.x_mm:.1f}", f"{sensor.y_mm:.1f}")
        sensors.add_row(sensor.ref, sensor.name, sensor.part or "", sensor.side or "", *place, pins[sensor.number])
    out().print(sensors)
    for reader in spec.readers:
        words = counted_sensors([spec.sensors[number - 1] for number in reader.switches])
        out().print(f"{reader.ref}: {reader.place}, {words}")


def _print_wires(spec: "SpecSummary") -> None:
    bundles = table(("bundle", "connector", "signals", "returns", "wire, m"), title="Bundles")
    for connector in dict.fromkeys(wire.connector for wire in spec.wires):
        wires = [wire for wire in spec.wires if wire.connector == connector]
        signals = sum(bool(wire.unit) for wire in wires)
        lengths = [wire.length_mm for wire in wires if wire.length_mm is not None]
        metres = f"{sum(lengths) / 1000:.2f}" if lengths else ""
        bundles.add_row(wires[0].bundle, connector, str(signals), str(len(wires) - signals), metres)
    out().print(bundles)


def _print_materials(spec: "SpecSummary") -> None:
    materials = table(("quantity", "what", "part number", "note"), title="Materials")
    for line in spec.materials:
        part = line.part if line.sure else f"{line.part} (not confirmed)"
        materials.add_row(f"{line.quantity:g} {line.unit}", line.what, part, line.note)
    out().print(materials)
