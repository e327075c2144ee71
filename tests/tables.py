"""Manifests of integer tables that nobody trained, and the codes of readings as a run has them."""

import hashlib
import json
from pathlib import Path

from thenar.compiler.firmware.sensors import CodeGrid, Sensor
from thenar.drivers.calibration import GloveCalibration
from thenar.runtime.code_line import CodeLine
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Origin, Proof, Recognised, Switch
from thenar.runtime.model.integers import IntegerTables, tables_to_bytes
from thenar.runtime.recipe import Recipe
from thenar.runtime.sources.rows import _Grid


def describe(tables: IntegerTables) -> Manifest:
    return Manifest(
        schema=SCHEMA,
        checksum="",
        thenar="0.1.0",
        tables_sha256=hashlib.sha256(tables_to_bytes(tables)).hexdigest(),
        ensemble_sha256="0" * 64,
        source=Origin("1" * 64, 10, "own", 20, joints=22),
        options=Recipe(0, 100, "both", 1.0, 4, 1),
        grasps=tuple(f"grasp {number}" for number in range(tables.n_classes)),
        switches=tuple(Switch(number, f"s{number}", 0.5) for number in range(tables.n_switches)),
        joints=tuple(Calibration(n, f"j{n}", "deg", 0, 0.0, 100, 50.0) for n in range(tables.n_joints)),
        proof=Proof(16, tables.scale, tables.bound, 6.5, 13.0, 10, 0),
        rates=(Recognised("training", 0, 1, 10, 10),),
    )


def grid_code(grid: CodeGrid, reading: int) -> int:
    """Return the code of a stream's number."""
    last = grid.first + grid.steps
    return min(max(_Grid((grid.low, grid.high), grid.first, last).code(reading), grid.first), last)


def code_of(sensor: Sensor, reading: int) -> int:
    """Return the code of a known sensor's reading."""
    assert sensor.readings is not None
    first, second = zip(sensor.readings, sensor.codes, strict=True)
    return CodeLine(first, second).code(reading if sensor.grid is None else grid_code(sensor.grid, reading))


def calibrated_glove(folder: Path, calibration: GloveCalibration) -> Harness:
    """Return a CyberGlove whose first sensors are those of a calibration."""
    (folder / "hand.toml").write_text(calibration.to_toml())
    names = [*(line.name for line in calibration.sensors), *(f"other {number}" for number in range(18))][:18]
    text = f'[cyberglove]\nport = "x"\njoints = {json.dumps(names)}\ncalibration = "{folder / "hand.toml"}"\n'
    return parse_harness(text, "glove.toml")
