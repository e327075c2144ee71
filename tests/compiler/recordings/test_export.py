import csv
import gzip
from dataclasses import replace
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.export import SUFFIXES, export, to_arff, to_csv
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import import_file
from thenar.compiler.recordings.taxonomy import own

from .conftest import grasp_sets


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("export")


# ARFF is for Weka alone. Parquet is read in a process of its own: tests/cli has a set of it.
@given(grasp_set=grasp_sets(), suffix=st.sampled_from(SUFFIXES[:-2]), codes=st.booleans())
def test_an_exported_table_reads_back_as_the_same_set(
    grasp_set: GraspSet, folder: Path, suffix: str, codes: bool
) -> None:
    table, columns = folder / f"table{suffix}", folder / "columns.toml"
    export(grasp_set, table, codes=codes, columns=columns)
    again, report = import_file(table, columns)
    assert again.fingerprint() == grasp_set.fingerprint()
    assert all(cost.largest_error <= 1e-9 * max(1e6, abs(cost.step) * 65536) for cost in report.coding)


def test_a_csv_holds_values_or_codes(small: GraspSet) -> None:
    assert to_csv(small).splitlines()[:3] == [
        "grasp,subject,object,trial,dead,thumb,palm,palm copy,index,wrist",
        "PoS,A,mug,0,0,0,1,1,-9.5,3.5",
        "PoH,A,mug,1,0,1,0,0,-9,3.5",
    ]
    assert to_csv(small, codes=True).splitlines()[1] == "PoS,A,mug,0,0,0,1,1,1,7"


def test_csv_cells_are_never_formulas_and_numbers_stay(small: GraspSet) -> None:
    types = own(["=cmd|' /C calc'!A0", "@SUM(1)", "-1+1"])
    odd = replace(
        small,
        switch_names=("=1+1", "+thumb", "palm", "'-palm"),
        grasps=np.array([*types.types, *types.types]),
        taxonomy=types,
        subjects=np.array(["-2", "A", "'A", "+", "=", "'=x"]),
    )
    header, *rows = csv.reader(to_csv(odd).splitlines())
    assert header == ["grasp", "subject", "object", "trial", "'=1+1", "'+thumb", "palm", "''-palm", "index", "wrist"]
    assert [row[0] for row in rows[:3]] == ["'=cmd|' /C calc'!A0", "'@SUM(1)", "'-1+1"]
    assert [row[1] for row in rows] == ["'-2", "A", "'A", "'+", "'=", "''=x"]
    assert [row[8] for row in rows] == ["-9.5", "-9", "-9", "-9.5", "-8.5", "-8"]


def test_an_arff_is_switches_joints_and_the_class_last(small: GraspSet) -> None:
    types = "PoS,PoH,PoI,PoE,PoD,Lat,Tpd,TVI,TVII,PMF,CMF,Tip,PE,Add"
    assert to_arff(small).splitlines()[:12] == [
        "@relation grasps",
        "",
        "@attribute dead {0,1}",
        "@attribute thumb {0,1}",
        "@attribute palm {0,1}",
        "@attribute 'palm copy' {0,1}",
        "@attribute index numeric",
        "@attribute wrist numeric",
        f"@attribute grasp {{{types}}}",
        "",
        "@data",
        "0,0,1,1,-9.5,3.5,PoS",
    ]


def test_what_arff_would_misread_is_quoted(small: GraspSet) -> None:
    joints = (replace(small.joints[0], name="50 % {a}"), replace(small.joints[1], name="it's \\"))
    grasp_set = replace(small, joints=joints)
    assert "@attribute '50 \\% {a}' numeric" in to_arff(grasp_set)
    assert "@attribute 'it\\'s \\\\' numeric" in to_arff(grasp_set)


def test_the_same_set_gives_the_same_gzip(small: GraspSet, tmp_path: Path) -> None:
    for name in ("a.csv.gz", "b.csv.gz"):
        export(small, tmp_path / name)
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()
    assert gzip.decompress((tmp_path / "a.csv.gz").read_bytes()).decode() == to_csv(small)


def test_another_suffix_is_refused(small: GraspSet, tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"table\.xlsx: an exported table ends in \.csv, .*\.arff or \.parquet"):
        export(small, tmp_path / "table.xlsx")
    assert list(tmp_path.iterdir()) == []


def test_twelve_digits_are_enough_for_every_code(small: GraspSet) -> None:
    joint = replace(small.joints[0], code_a=0, value_a=1e6, code_b=65535, value_b=1e6 + 70)
    values = [float(f"{value:.12g}") for value in joint.value(np.arange(65536))]
    assert joint.code(values).tolist() == list(range(65536))
