"""Recordings as tables and as sets: CSV, ARFF, npz, gzipped or not, columns.toml, `.grasps`."""

import gzip
from collections.abc import Callable
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from material import GRASPS, SENSORS, Format, grasp_set
from mutating import npz_file, sealed, table_file, toml_file, zipped

from thenar.compiler.placement.placement import place
from thenar.compiler.recordings.export import to_arff, to_csv
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import import_file
from thenar.compiler.recordings.summary import summarise

_COLUMNS = f"""\
label = "grasp"
subject = "subject"
object = "object"
trial = "trial"
switches = ["finger_*"]
missing = "drop"
[[joints]]
columns = ["{SENSORS[0]}"]
unit = "raw"
codes = true
calibration = {{ code_a = 1, value_a = 1.0, code_b = 255, value_b = 255.0 }}
[[joints]]
columns = ["{SENSORS[1]}", "{SENSORS[2]}"]
grid = 0.25
origin = -10.0
[labels]
"Power" = "power"
"""
_OF_TYPES = _COLUMNS.replace('missing = "drop"', f'taxonomy = ["{GRASPS[0]}", "{GRASPS[1]}", "{GRASPS[2]}"]')


@cache
def _csv() -> bytes:
    lines = to_csv(grasp_set()).splitlines(keepends=True)
    # A Kamakura type by one of its aliases, a missing value, a quoted cell.
    lines[2] = lines[2].replace("anna", '"an,""na"""')
    lines[3] = lines[3].replace("bert", "?")
    return "".join(lines[:12]).encode()


@cache
def _arff() -> bytes:
    return to_arff(grasp_set(), meta=True).encode()


@cache
def _npz() -> bytes:
    grasps = grasp_set()
    arrays: dict[str, Any] = {
        "grasp": grasps.grasps,
        "subject": np.char.encode(grasps.subjects, "utf-8"),
        "object": grasps.objects,
        "trial": grasps.trials,
        **{name: grasps.switches[:, number] for number, name in enumerate(grasps.switch_names)},
        **{joint.name: grasps.codes[:, number] for number, joint in enumerate(grasps.joints)},
    }
    file = BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def _grasps() -> bytes:
    from thenar.compiler.recordings import graspset as file
    from thenar.runtime.sealed import seal

    return seal(file.KIND, file.VERSION, file._pack(grasp_set()))


def _use(grasps: GraspSet) -> None:
    """Do what follows on an import: look at the set, choose switches, export it."""
    summarise(grasps)
    if grasps.switch_names:
        place(grasps, 2)
    to_csv(grasps)
    to_arff(grasps, meta=True)
    grasps.fingerprint()


def _table(suffix: str) -> Callable[[bytes, Path], None]:
    """Return what imports a table with this suffix, under a columns.toml that is sound."""

    def read(data: bytes, folder: Path) -> None:
        table, columns = folder / f"table{suffix}", folder / "columns.toml"
        table.write_bytes(data)
        columns.write_text(_COLUMNS)
        _use(import_file(table, columns)[0])

    return read


def _columns(data: bytes, folder: Path) -> None:
    table, columns = folder / "table.csv", folder / "columns.toml"
    table.write_bytes(_csv())
    columns.write_bytes(data)
    _use(import_file(table, columns)[0])


def _set(data: bytes, folder: Path) -> None:
    path = folder / "set.grasps"
    path.write_bytes(data)
    _use(GraspSet.load(path))


FORMATS = (
    Format("csv", lambda: [_csv()], table_file, _table(".csv")),
    Format("csv.gz", lambda: [gzip.compress(_csv(), mtime=0)], zipped(table_file), _table(".csv.gz")),
    Format("arff", lambda: [_arff()], table_file, _table(".arff")),
    Format("arff.gz", lambda: [gzip.compress(_arff(), mtime=0)], zipped(table_file), _table(".arff.gz")),
    Format("npz", lambda: [_npz()], npz_file, _table(".npz")),
    Format("columns.toml", lambda: [_COLUMNS.encode(), _OF_TYPES.encode()], toml_file, _columns),
    Format("grasps", lambda: [_grasps()], sealed(npz_file), _set),
)
