import csv
import gzip
import random
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.cells import Column
from thenar.compiler.recordings.columns import ColumnRoles, TextFormat, read_columns
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import ImportReport, import_table
from thenar.compiler.recordings.propose import ColumnProposal, listed, propose, propose_file
from thenar.compiler.recordings.table import Table
from thenar.drivers.errors import ThenarError


def roles(proposal: ColumnProposal) -> dict[str, str]:
    """Return role by column."""
    return {name: role.role for role in proposal.roles for name in role.columns}


def looked_at(**columns: Column) -> ColumnProposal:
    rows = len(next(iter(columns.values())))
    return propose(Table("t.csv", columns, np.arange(2, rows + 2)))


def imported(path: Path, folder: Path) -> tuple[ColumnProposal, GraspSet, ImportReport]:
    """Import a table as it is found to be; what is found is also what its columns.toml says."""
    table, proposal = propose_file(path)
    (folder / "columns.toml").write_text(proposal.toml(), encoding="utf-8")
    assert read_columns(folder / "columns.toml") == proposal.columns
    return proposal, *import_table(table, proposal.columns)


HEAD = ["Proband", "Griffart", "Gegenstand", "Versuch", "Zeit_ms", *(f"pad{n:02}" for n in range(1, 25))]
HEAD += [f"flex{n}" for n in range(1, 6)]


def glove(delimiter: str = ",", decimal: str = ".") -> str:
    """Return the table of a home-made glove: 24 pads of 12 bits, 5 flex sensors, 6 people, 15 frames a trial."""
    chance = random.Random(1)
    rows: list[list[Any]] = [HEAD]
    for person in ("Jörg", "Anna", "Bea", "Käthe", "Dan", "Eva"):
        for grasp in ("Kugelgriff", "Hakengriff", "Schlüsselgriff"):
            for trial in ("T1", "T2", "001 - Copy"):
                rest = [chance.choice((chance.randint(0, 60), chance.randint(1500, 4000))) for _ in range(24)]
                bends = [chance.uniform(0, 90) for _ in range(5)]
                for frame in range(15):
                    pads: list[Any] = [min(4095, max(0, level + chance.randint(-8, 8))) for level in rest]
                    pads[chance.randrange(24)] = "" if chance.random() < 0.05 else 7
                    flex = [f"{bend + chance.uniform(-1, 1):.2f}".replace(".", decimal) for bend in bends]
                    rows.append([person, grasp, "Becher", trial, 20 * frame, *pads, *flex])
    lines = [[f'"{cell}"' if delimiter in str(cell) else str(cell) for cell in row] for row in rows]
    return "".join(delimiter.join(line) + "\n" for line in lines)


@pytest.mark.parametrize(
    ("name", "delimiter", "decimal", "encoding"),
    [
        ("glove.csv", ",", ".", "utf-8"),
        ("glove.csv", ";", ",", "latin-1"),
        ("glove.csv", ",", ",", "utf-8-sig"),
        ("glove.tsv", "\t", ".", "utf-16"),
        ("glove.txt", "\t", ",", "cp1252"),
        ("glove.xlsx", "", ".", ""),
        ("glove.parquet", "", ".", ""),
    ],
)
def test_the_table_of_a_home_made_glove_is_imported_as_it_comes(
    name: str, delimiter: str, decimal: str, encoding: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    if delimiter:
        path.write_bytes(glove(delimiter, decimal).encode(encoding))
    else:
        frame = pd.read_csv(StringIO(glove()))
        frame.to_excel(path, index=False) if name.endswith("xlsx") else frame.to_parquet(path)
    proposal, grasp_set, report = imported(path, tmp_path)
    expected = dict(zip(HEAD, ["subject", "label", "object", "trial", "time"], strict=False))
    expected |= {column: "taxels" if column.startswith("pad") else "joints" for column in HEAD[5:]}
    assert roles(proposal) == expected
    assert (report.frames, report.trials, report.subjects, report.grasp_types) == (810, 54, 6, 3)
    assert grasp_set.taxels.shape == (810, 24)
    assert {(taxel.unit, taxel.code_a, taxel.code_b, taxel.value_b) for taxel in grasp_set.taxel_columns} == {
        ("counts", 0, 4095, 4095.0)
    }
    assert report.notes[-1].startswith("24 taxels stay analog: a placement chooses their levels; to make switches")
    assert [joint.step for joint in grasp_set.joints] == pytest.approx([0.01] * 5)
    assert sorted(set(grasp_set.subjects.tolist())) == ["Anna", "Bea", "Dan", "Eva", "Jörg", "Käthe"]
    (filled,) = report.warnings
    assert filled.kind == "filled cells"
    assert filled.message.endswith("more)")
    assert any("'001 - Copy' is 1, 'T1' is 2, 'T2' is 3" in note for note in report.notes)
    first = glove().splitlines()[1].split(",")
    assert grasp_set.joints[0].value(grasp_set.codes[0, 0]) == pytest.approx(float(first[-5]))


def test_trials_of_a_published_set_are_found_over_two_columns(r2g_table: Path, tmp_path: Path) -> None:
    proposal, grasp_set, report = imported(r2g_table, tmp_path)
    assert proposal.columns.trial == ("side", "trial")
    assert (proposal.columns.label, proposal.columns.object, proposal.columns.subject) == (
        "action",
        "object",
        "subject",
    )
    assert (proposal.columns.time, proposal.columns.frames) == ("t_ms", None)
    assert (report.frames, report.trials, report.subjects, report.objects, report.grasp_types) == (
        16119,
        1370,
        29,
        4,
        6,
    )
    # The same trials, told apart by hand.
    with gzip.open(r2g_table, "rt") as file:
        rows = list(csv.DictReader(file))
    keys = [tuple(row[name] for name in ("subject", "object", "action", "side", "trial")) for row in rows]
    seen: dict[tuple[str, ...], int] = {}
    assert grasp_set.trial_ids.tolist() == [seen.setdefault(key, len(seen)) for key in keys]
    assert grasp_set.joint_names[-1] == "hand_velocity"
    assert len(grasp_set.joints) == 17


def test_the_icub_recordings_are_told_by_values_where_names_say_nothing(icub_table: Path, tmp_path: Path) -> None:
    proposal, grasp_set, report = imported(icub_table, tmp_path)
    assert (proposal.columns.label, proposal.columns.trial) == ("object", "rep")
    assert grasp_set.switches.shape == (230, 60)
    assert (grasp_set.taxels.shape, report.taxels, report.joints) == ((230, 60), 60, 9)
    assert {taxel.code_b for taxel in grasp_set.taxel_columns} == {255}
    left_out = {name for name, role in roles(proposal).items() if role == "left out"}
    assert left_out == {"trial_id", "shape", "n_slices"}
    assert report.trials == 230


def test_the_aml_labels_are_told_to_be_feixs(aml_table: Path, tmp_path: Path) -> None:
    proposal, _, report = imported(aml_table, tmp_path)
    assert (proposal.columns.taxonomy, report.grasp_types, report.trials) == ("feix33", 8, 699)
    assert roles(proposal)["n_frames"] == "left out"


def test_inputs_are_told_by_values_where_names_say_nothing() -> None:
    chance = np.random.default_rng(1)
    proposal = looked_at(
        grasp=["a", "b"] * 20,
        x1=chance.integers(0, 2, 40),
        x2=np.where(chance.random(40) < 0.3, 3000, 0) + chance.integers(0, 50, 40),
        x3=chance.integers(0, 4096, 40),
        x4=chance.normal(size=40),
        x5=np.full(40, 7.0),
        x6=np.arange(40),
        x7=np.full(40, np.nan),
        x8=["yes", "no"] * 20,
        x9=["True", "False"] * 20,
    )
    found = roles(proposal)
    assert found == {
        "grasp": "label",
        **dict.fromkeys(("x1", "x9"), "switches"),
        **dict.fromkeys(("x2", "x3", "x4"), "joints"),
        **dict.fromkeys(("x5", "x6", "x7", "x8"), "left out"),
    }
    assert roles(looked_at(grasp=["a", "b"] * 2, u=np.array([0, 9, 1, 3000]), v=np.array([0, 900, 2000, 3000]))) == {
        "grasp": "label",
        "u": "taxels",
        "v": "joints",
    }


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("GraspType", "subjectID", "Trial No", "TimeStamp"), ("label", "subject", "trial", "time")),
        (("posture", "user", "rep", "t"), ("label", "subject", "trial", "time")),
        (("class", "participant", "repetitions", "frame"), ("label", "subject", "trial", "time")),
        (("prise", "sujet", "essai", "temps_ms"), ("label", "subject", "trial", "time")),
    ],
)
def test_roles_are_told_by_names(names: tuple[str, ...], expected: tuple[str, ...]) -> None:
    cells: list[Column] = [
        ["a", "b"] * 4,
        ["x"] * 4 + ["y"] * 4,
        np.array([1, 1, 1, 1, 2, 2, 2, 2]),
        np.array([0, 5] * 4),
    ]
    found = roles(looked_at(**dict(zip(names, cells, strict=True)), s=np.array([0, 1] * 4)))
    assert tuple(found[name] for name in names) == expected
    assert found["s"] == "switches"


def test_frames_that_start_anew_are_trials() -> None:
    found = looked_at(grasp=["a"] * 6 + ["b"] * 6, time=np.array([0, 1, 2] * 4), s=np.array([0, 1] * 6))
    assert (found.columns.frames, found.lacks) == ("restart", "")
    assert "starts anew 4 times" in found.roles[1].reason


def test_frames_that_nothing_tells_apart_are_asked_about() -> None:
    found = looked_at(grasp=["a"] * 6 + ["b"] * 6, s=np.array([0, 1] * 6))
    assert found.lacks.startswith("no column tells which rows are frames of one trial: name it (trial = ...)")
    assert found.lacks in found.toml()
    stated = found.independent()
    assert (stated.lacks, stated.columns.frames) == ("", "independent")


def test_the_columns_toml_holds_the_reasons_and_any_names(tmp_path: Path) -> None:
    odd: dict[str, Column] = {
        'a "b" [c]*': ["x", "y"],
        "p[1]": np.array([0, 1]),
        "p[2]": np.array([1, 0]),
        "ä\u200b": ["u", "v"],
    }
    found = looked_at(grasp=["x", "y"], **odd)
    text = found.toml()
    assert "# grasp: label: its name; 2 different\n" in text
    assert "\u200b" not in text.partition("\n\n")[0]
    (tmp_path / "columns.toml").write_text(text, encoding="utf-8")
    assert read_columns(tmp_path / "columns.toml") == found.columns
    assert found.columns.switches == ("p[[]1]", "p[[]2]")


def test_a_star_takes_exactly_the_columns_that_are_alike() -> None:
    bits = {f"s{number}": np.array([0, 1]) for number in range(5)}
    assert looked_at(grasp=["a", "b"], **bits).columns.switches == ("s*",)
    assert looked_at(grasp=["a", "b"], **bits, sx=["u", "v"]).columns.switches == tuple(bits)


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        ({"x": np.array([0.5, 1.5, 2.5])}, "no column looks like the grasp type: name it in a columns.toml"),
        ({"grasp": ["a", "b", "a"], "note": ["u", "v", "w"]}, "no column holds numbers that change: it has no inputs"),
    ],
)
def test_a_table_without_labels_or_inputs_is_refused(columns: dict[str, Column], reason: str) -> None:
    with pytest.raises(TableError, match=f"t.csv: {reason}"):
        looked_at(**columns)


CELLS = st.sampled_from(["", "?", "0", "1", "a", "T1", "1.5", "-3", "1e300", "NaN", "x y"])


@given(st.lists(st.tuples(st.sampled_from(["grasp", "trial", "t", "pad1", "x", "object", ""]), CELLS, CELLS, CELLS)))
def test_any_table_is_proposed_for_or_refused(columns: list[tuple[str, str, str, str]]) -> None:
    cells: dict[str, Column] = {f"{name}{'_' * place}": list(column) for place, (name, *column) in enumerate(columns)}
    table = Table("t.csv", cells, np.arange(3))
    with suppress(ThenarError):
        proposal = propose(table, TextFormat(";"))
        assert isinstance(proposal.columns, ColumnRoles)
        if not proposal.lacks:
            assert len(import_table(table, proposal.columns)[0]) <= 3


def test_many_columns_are_listed_by_the_first_and_the_last() -> None:
    assert listed(("a", "b", "c")) == "a, b, c"
    assert listed(("a", "b", "c", "d")) == "a ... d (4)"


def test_a_workbook_of_a_german_study_needs_no_columns_toml(tmp_path: Path) -> None:
    """Notes on the first sheet, the frames on the longest, decimal commas in text, and a unit (N), which is no note."""
    draw = random.Random(1)
    rows = [
        (person, grip, trial, *(f"{draw.uniform(0, 90):.1f}".replace(".", ",") for _ in range(2)))
        for person in ("P1", "P2")
        for grip in ("Hakengriff", "Spitzgriff")
        for trial in range(1, 5)
        for _ in range(3)
    ]
    frame = pd.DataFrame(rows, columns=["Proband", "Griffart", "Versuch", "Zeigef. MCP", "Kraft Daumen (N)"])
    with pd.ExcelWriter(tmp_path / "study.xlsx", engine="openpyxl") as writer:
        pd.DataFrame({"Studie": ["2025"]}).to_excel(writer, sheet_name="Info", index=False)
        frame.to_excel(writer, sheet_name="Daten", index=False)
    table, proposal = propose_file(tmp_path / "study.xlsx")
    assert len(table.rows) == len(frame)
    assert table.notes == ("sheets left out: Info; Daten was read",)
    assert "decimal sign: a comma" in proposal.remarks
    assert roles(proposal)["Kraft Daumen (N)"] == "taxels"
