"""Recordings as tables and as sets: CSV, npz, gzipped or not, columns.toml, `.grasps`."""

import gzip
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
from material import GRASPS, SENSORS, Format, grasp_set
from mutating import Member, altered, npz_file, sealed, table_file, toml_file, zip_file, zipped

from thenar.compiler.placement.placement import place
from thenar.compiler.recordings.columns import read_columns
from thenar.compiler.recordings.export import to_arff, to_csv
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import import_file, import_table
from thenar.compiler.recordings.propose import propose_file
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
def _strange() -> bytes:
    """Return lines before the header, a list in each row, and blanks as delimiter."""
    values = np.random.default_rng(2).normal(0, 9, (9, len(GRASPS), 2)).round(2)
    lists = [[f"[{first},{second}]" for first, second in row] for row in values.tolist()]
    rows = [f"{grasp}   {trial} {lists[trial][n]}" for trial in range(9) for n, grasp in enumerate(GRASPS)]
    return "\n".join(["nRows=27", "endheader", "# grasp trial data", *rows]).encode()


def _tabs() -> bytes:
    return to_csv(grasp_set(), delimiter="\t").encode()


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

    plain = grasp_set()
    nothing = np.where(np.arange(len(plain)) % 5, plain.grasps, "none")
    timed = replace(plain, grasps=nothing, times_us=10_000 * np.arange(len(plain)))
    return seal(file.KIND, file.VERSION, file._pack(timed))


def _use(grasps: GraspSet) -> None:
    """Do what follows on an import: look at the set, choose switches, export it."""
    summarise(grasps)
    if grasps.switch_names:
        place(grasps, prune=2)
    to_csv(grasps)
    to_arff(grasps)
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


def _proposed(data: bytes, folder: Path) -> None:
    """Import a table as it is found to be."""
    path = folder / "table.csv"
    path.write_bytes(data)
    table, proposal = propose_file(path)
    (folder / "columns.toml").write_text(proposal.toml(), encoding="utf-8")
    columns = read_columns(folder / "columns.toml")
    assert columns == proposal.columns
    if not proposal.lacks:
        _use(import_table(table, columns)[0])


def _latin() -> bytes:
    """Return a table with semicolons, decimal commas and Latin-1."""
    lines = _csv().decode().replace("anna", "Jörg").splitlines()
    return "".join(line.replace(",", ";") + f";0,{number}\n" for number, line in enumerate(lines)).encode("latin-1")


@cache
def _foreign(suffix: str) -> bytes:
    """Return the grasps as another program writes them, the same bytes on every day."""
    import h5py
    import pandas
    from scipy.io import savemat

    frame = pandas.read_csv(BytesIO(to_csv(grasp_set()).encode()))
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"table{suffix}"
        if suffix == ".xlsx":
            frame.to_excel(path, index=False)
            with ZipFile(path) as dated:
                return zip_file(
                    [
                        Member(name, dated.read(name), ZIP_DEFLATED)
                        for name in dated.namelist()
                        if "docProps" not in name
                    ]
                )
        if suffix == ".parquet":
            frame.to_parquet(path)
        elif suffix == ".h5":
            with h5py.File(path, "w") as file:
                for name, column in frame.items():
                    file[str(name)] = column.to_numpy(object if column.dtype == "str" else None)
        else:
            savemat(path, {name: column.to_numpy(object) for name, column in frame.items()}, oned_as="column")
            return b"MATLAB 5.0 MAT-file".ljust(116) + path.read_bytes()[116:]
        return path.read_bytes()


def _of(suffix: str) -> Format:
    mutate = npz_file if suffix == ".xlsx" else altered
    return Format(suffix[1:], lambda: [_foreign(suffix)], mutate, _table(suffix), weight=0.03)


FORMATS = (
    Format("csv without columns.toml", lambda: [_csv(), _latin(), _strange()], table_file, _proposed),
    *map(_of, (".xlsx", ".parquet", ".h5", ".mat")),
    Format("csv", lambda: [_csv()], table_file, _table(".csv")),
    Format("csv.gz", lambda: [gzip.compress(_csv(), mtime=0)], zipped(table_file), _table(".csv.gz")),
    Format("mot", lambda: [b"x\nendheader\n" + _tabs()], table_file, _table(".mot")),
    Format("trc", lambda: [b"PathFileType\n\n\n" + _tabs().replace(b"\n", b"\n\n", 1)], table_file, _table(".trc")),
    Format("npz", lambda: [_npz()], npz_file, _table(".npz"), weight=0.03),
    Format("columns.toml", lambda: [_COLUMNS.encode(), _OF_TYPES.encode()], toml_file, _columns),
    Format("grasps", lambda: [_grasps()], sealed(npz_file), _set),
)
