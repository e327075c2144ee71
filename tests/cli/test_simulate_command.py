import json
from pathlib import Path

import msgspec
import pytest

from thenar.cli import run
from thenar.compiler.recordings.graspset import GraspSet
from thenar.simulator import load_scene, simulate
from thenar.simulator.scenes import shipped

from .conftest import refusal, works

SMALL = ("--jobs", "1", "--repetitions", "1")
Captured = pytest.CaptureFixture[str]


def test_a_shipped_scene_becomes_a_set_and_says_that_it_is_simulated(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "set.grasps"
    assert run(["simulate", "quick", *SMALL, "-o", str(path)]) == 0
    made = GraspSet.load(path)
    assert {*made.subjects.tolist()} == {"A", "C"}
    printed = capsys.readouterr().out
    assert f"{path}: {made.size}, simulated: scene quick, seed 1, 2 subjects, 28 grasps" in printed
    assert "Grasps, simulated" in printed


def test_the_summary_has_a_row_for_every_grasp_type(tmp_path: Path) -> None:
    done = works("simulate", "quick", *SMALL, "-o", tmp_path / "set.grasps")
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in done.stdout.splitlines()]
    assert [row[:2] for row in rows if len(row) == 11] == [[name, "2"] for name in load_types()]


def load_types() -> tuple[str, ...]:
    return tuple(dict.fromkeys(item.grasp for item in load_scene("quick").objects))


def test_json_holds_the_whole_report(tmp_path: Path) -> None:
    path = tmp_path / "set.grasps"
    report = json.loads(works("simulate", "quick", *SMALL, "-o", path, "--json").stdout)
    assert report["simulated"] is True
    assert (report["scene"], report["repetitions"], report["rows"]) == ("quick", 28, len(GraspSet.load(path)))
    assert len(report["grasps"]) == 14
    assert {"name", "own", "calls", "grasps", "draws", "seconds", "us_a_grasp", "share"} <= report["steps"][0].keys()


def test_a_scene_can_be_changed_on_the_way(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "set.grasps"
    changes = ["--repetitions", "2", "--seed", "5", "--subject", "C"]
    assert run(["simulate", "quick", "--jobs", "1", *changes, "-o", str(path), "--json"]) == 0
    scene = load_scene("quick")
    changed = msgspec.structs.replace(scene, repetitions=2, seed=5, subjects=scene.subjects[1:])
    assert GraspSet.load(path).fingerprint() == simulate(changed, jobs=1).grasp_set.fingerprint()
    assert json.loads(capsys.readouterr().out)["subjects"] == ["C"]


def test_the_first_subjects_of_a_scene_are_those_that_their_names_give(tmp_path: Path) -> None:
    first, named = tmp_path / "first.grasps", tmp_path / "named.grasps"
    assert run(["simulate", "crowd", *SMALL, "--subjects", "2", "-o", str(first)]) == 0
    done = works("simulate", "crowd", *SMALL, "--subject", "P002", "--subject", "P001", "-o", named)
    assert "2 subjects, 28 grasps" in done.stdout
    assert first.read_bytes() == named.read_bytes()


def test_rests_between_movements_are_simulated_and_counted_as_none(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "set.grasps"
    assert run(["simulate", "continuous", *SMALL, "--subject", "C", "--rest", "flat", "-o", str(path)]) == 0
    made = GraspSet.load(path)
    scene = load_scene("continuous-rest").varied(repetitions=1, subjects=["C"], rest="flat")
    again = simulate(msgspec.structs.replace(scene, name="continuous"), jobs=1).grasp_set
    assert made.fingerprint() == again.fingerprint()
    assert f"{path}: {made.size}, simulated" in capsys.readouterr().out


def test_more_draws_fresh_grasps_and_help_explains_the_seed(tmp_path: Path) -> None:
    path = tmp_path / "fresh.grasps"
    done = works("simulate", "quick", *SMALL, "--more", "3", "-o", path)
    assert "scene quick, seed 1, after repetition 1, 2 subjects, 84 grasps" in done.stdout
    made = GraspSet.load(path)
    assert made.simulated == "scene quick, seed 1, 3 more after 1 repetitions"
    assert made.trials.min() >= 14
    said = " ".join(works("simulate", "--help").stdout.split())
    assert "habits, calibrations, the glove's parts, all grasps. Hand sizes stay." in said


HASTY = "\n[effects.contact.quasistatic]\nmost_steps = 12\n"


@pytest.fixture
def hasty(tmp_path: Path) -> Path:
    """Return a scene in which not every hand comes to rest."""
    path = tmp_path / "hasty.toml"
    path.write_text(shipped()["quick"].read_text() + HASTY)
    return path


def test_what_did_not_settle_is_warned_of_by_name(hasty: Path, tmp_path: Path) -> None:
    path = tmp_path / "set.grasps"
    unsettled = json.loads(works("simulate", hasty, *SMALL, "-o", path, "--json").stdout)["unsettled"]
    warning = works("simulate", hasty, *SMALL, "-o", path, "--overwrite").stderr
    assert warning.startswith(f"warning: {len(unsettled)} of 28 grasps did not settle, and are left out of the set")
    for one in unsettled[:10]:
        place = f"subject {one['subject']}, {one['grasp']} with {one['object']}, repetition {one['repetition']}"
        assert f"{place}: {one['why']}" in warning
    assert ("more: --json lists them all" in warning) == (len(unsettled) > 10)
    assert len(GraspSet.load(path)) == 28 - len(unsettled)


def test_what_did_not_settle_is_kept_when_asked(hasty: Path, tmp_path: Path) -> None:
    path = tmp_path / "set.grasps"
    done = works("simulate", hasty, *SMALL, "-o", path, "--keep-unsettled")
    assert "did not settle, and are kept as requested" in done.stderr
    assert len(GraspSet.load(path)) == 28


def test_shipped_scenes_are_listed_with_what_they_are() -> None:
    lines = works("simulate", "--list").stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(shipped())
    assert len(lines) == 12
    assert all("Simulated." in line for line in lines)
    assert [scene["name"] for scene in json.loads(works("simulate", "--list", "--json").stdout)] == list(shipped())


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["quick"], "name the set to write: -o SET.grasps"),
        ([], "name a scene"),
        (["quick", "--list"], "--list shows all shipped scenes: give it alone"),
        (["no/such.toml"], "such.toml"),
        (["quick", "--subject", "Q"], "scene quick has no subject 'Q'"),
        (["quick", "--subjects", "3"], "scene quick has 2 subject(s), 3 are requested"),
        (["quick", "--repetitions", "0"], "repetitions"),
        (["quick", "-o", "no/such/folder/set.grasps"], "There is no folder"),
        (
            ["quick", "--rest", "flat", "-o", "new.grasps"],
            "recording.rest: for the hand to return to an open rest the scene needs",
        ),
    ],
)
def test_what_cannot_be_done_is_one_sentence(arguments: list[str], reason: str) -> None:
    said = refusal("simulate", *arguments)
    assert reason in said
    assert (said[:8], said.count("\n")) == ("thenar: ", 1)


@pytest.mark.parametrize(
    ("added", "sentence"),
    [
        ("[effects.hand.transition]", "line 45: effects.hand.transition: there is no frame before contact"),
        ("[effects.switch.stuck_open]\ncount = 161", "line 46: effects.switch.stuck_open.count: 161 switches cannot"),
    ],
)
def test_faults_of_combined_effects_name_file_and_line(added: str, sentence: str, tmp_path: Path) -> None:
    scene = tmp_path / "bad.toml"
    text = shipped()["quick"].read_text()
    scene.write_text(text + "\n" * (44 - text.count("\n")) + added)
    said = refusal("simulate", scene, "-o", tmp_path / "set.grasps")
    assert said.startswith(f"thenar: bad.toml, {sentence}")
    assert said.count("\n") == 1
