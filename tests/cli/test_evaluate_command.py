import json
from pathlib import Path

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler.recordings.graspset import GraspSet, Joint

from ..sets import grasp_set_of
from .conftest import refusal, works

pytestmark = pytest.mark.usefixtures("one_way_to_train")
QUICK = ("--rounds", "2", "--repeats", "1", "--jobs", "1")


def make_set(per_type: int = 8) -> GraspSet:
    random = np.random.default_rng(1)
    labels = np.tile(np.repeat([0, 1, 2], per_type), 2)
    switches = np.eye(3, 6, dtype=bool)[labels] ^ (random.random((len(labels), 6)) < 0.1)
    return grasp_set_of(
        ["hook", "pinch [tip]", "power"],
        labels,
        switches=switches,
        codes=50 * labels[:, np.newaxis] + random.integers(0, 60, (len(labels), 1)),
        joints=(Joint("thumb", "deg", 0, 0.0, 200, 100.0),),
        subjects=np.repeat(["Ann", "[b]Bob"], len(labels) // 2),
        objects=np.full(len(labels), "cup"),
        trials=np.tile(np.arange(per_type), 6),
    )


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("sets") / "set.grasps"
    make_set().save(path)
    return str(path)


def test_the_papers_tables_are_printed_with_both_protocols_explained(
    grasps: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["evaluate", grasps, *QUICK, "--protocol", "both"]) == 0
    printed, complaints = capsys.readouterr()
    for text in (
        "Protocol paper: The placement is chosen once, from all rows",
        "Protocol nested: The placement is chosen anew inside each training fold",
        "Tables II and V): paper protocol",
        "Tables III and VI): nested protocol",
        "Tables IV and VII): paper protocol",
        "ID3 compared with other placements of as many switches, selected switches: nested protocol",
        "Angle + NoSel-Co",
        "placement of subject [b]Bob",
        "48 trials, 3 grasp types; 4 stratified folds of whole trials, 1 repeat",
    ):
        assert text in printed
    assert not complaints


def test_every_table_names_its_method_and_its_trainer_with_their_settings(grasps: str, tmp_path: Path) -> None:
    tables = "compositions,pruning,baselines"
    logit = ("--trainer", "logit", "--penalty", "2", "--smoothness", "3", "--prune", "4")
    asked = ("--repeats", "1", "--jobs", "1", "--tables", tables, "--protocol", "nested")
    printed = " ".join(works("evaluate", grasps, *asked, *logit, "-o", tmp_path / "result.json").stdout.split())
    methods = {
        "compositions": "id3, S = 4",
        "pruning": "id3, S of the row, all subjects pooled",
        "baselines": "that of the row, as many elements as id3, S = 4",
    }
    written = json.loads((tmp_path / "result.json").read_text())["tables"]
    assert {table["name"]: table["recipe"]["method"] for table in written} == methods
    for table in written:
        assert table["recipe"]["trainer"].startswith("logit, ")
        assert {"penalty 2", "smoothness 3"} <= set(table["recipe"]["trainer"].split(", "))
        assert f"placement: {table['recipe']['method']}; trainer: {table['recipe']['trainer']}" in printed
    # Rounds are LogitBoost's.
    assert "rounds" not in printed


def test_every_rate_has_its_interval_in_percent(grasps: str, capsys: pytest.CaptureFixture[str]) -> None:
    done = works("evaluate", grasps, *QUICK, "--tables", "compositions", "--protocol", "paper", "--json")
    result = json.loads(done.stdout)["tables"][0]["rows"][0]
    rate = result["cells"][0]["rate"]
    assert run(["evaluate", grasps, *QUICK, "--tables", "compositions", "--protocol", "paper"]) == 0
    expected = f"{100 * rate['mean']:.1f} [{100 * rate['low']:.1f}, {100 * rate['high']:.1f}]"
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "Angle + All-Co" in line)
    assert expected in line
    assert (rate["of"], rate["unit"], result["frames"]) == ("within subject", "trials", None)
    average = result["rate"]
    last = f"{100 * average['mean']:.1f} [{100 * average['low']:.1f}, {100 * average['high']:.1f}]"
    assert line.rstrip(" │").endswith(last)
    assert last != expected


def test_json_on_stdout_and_in_the_file_are_one_document(grasps: str, tmp_path: Path) -> None:
    output = tmp_path / "result.json"
    arguments = ["--prune", "3", "--prune-list", "5, 0,5", "--seed", "7", "--subject", "Ann"]
    arguments += ["--tables", "pruning, generality,compositions"]
    result = json.loads(works("evaluate", grasps, *QUICK, *arguments, "--json", "-o", output).stdout)
    assert result == json.loads(output.read_text())
    recipe = {"prune": 3, "seed": 7, "rounds": 2, "trainer": "logitboost"}
    assert recipe.items() <= result["options"].pop("recipe").items()
    design = {"subjects": ["Ann"], "prune_list": [5, 0], "scheme": "trial"}
    assert design.items() <= result["options"].items()
    assert {table["name"] for table in result["tables"]} == {"compositions", "pruning"}
    assert result["left_out"] == [{"name": "generality", "reason": "another's placement needs a second subject"}]


def test_other_cuts_say_what_they_are(grasps: str) -> None:
    done = works("evaluate", grasps, *QUICK, "--by", "subject", "--tables", "compositions")
    assert "one subject left out" in done.stdout


def test_a_composition_without_inputs_is_marked_and_explained(grasps: str) -> None:
    printed = works("evaluate", grasps, *QUICK, "--prune", "1000", "--tables", "compositions").stdout
    assert "the most frequent grasp type is predicted" in printed
    assert any("VI " in line and "]*" in line for line in printed.splitlines())


def test_a_grasp_type_too_rare_for_folds_warns_on_stderr(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_set(per_type=3).save(tmp_path / "few.grasps")
    assert run(["evaluate", str(tmp_path / "few.grasps"), *QUICK, "--tables", "compositions", "--json"]) == 0
    printed, complaints = capsys.readouterr()
    assert "warning: subject Ann has 3 trial(s) of hook: fewer than the 4 folds" in complaints.replace("\n", " ")
    assert len(json.loads(printed)["warnings"]) == 6


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--subject", "Zoe"], "no subject 'Zoe' in the set; its subjects are Ann, [b]Bob"),
        (["--by", "object"], "leaving one object out needs two or more"),
        (["--folds", "100"], "24 rows cannot be cut into 100 folds"),
        (["--folds", "1"], "--folds"),
        (["--prune-list", "0,x"], "'0,x' is not a list of whole numbers such as 0,13,62"),
    ],
)
def test_a_users_mistake_ends_with_2_and_a_sentence(grasps: str, arguments: list[str], reason: str) -> None:
    assert reason in refusal("evaluate", grasps, *QUICK, *arguments)


def test_trainers_are_compared_in_a_table(grasps: str) -> None:
    printed = works("evaluate", grasps, *QUICK, "--folds", "2", "--tables", "trainers", "--protocol", "nested").stdout
    for text in ("against logitboost", "discriminant", "linear", "logit ", "pairs", ", p "):
        assert text in printed


def test_the_recipe_of_the_tables_is_the_one_that_is_asked_for(grasps: str) -> None:
    tables = ["--tables", "compositions,baselines,pruning", "--protocol", "nested", "--jobs", "1", "--repeats", "1"]
    recipe = ["--method", "elimination", "--keep", "2", "--never", "s0", "--trainer", "auto", "--rounds", "2"]
    study = json.loads(works("evaluate", grasps, *tables, *recipe, "--json").stdout)
    compositions, baselines = study["tables"]
    assert compositions["recipe"]["method"] == "elimination, keep 2, without s0"
    assert compositions["recipe"]["trainer"] == "chosen from the training rows"
    selected = next(row for row in compositions["rows"] if row["name"] == "VI")
    assert selected["switches"]["most"] == 2
    assert [row["name"] for row in baselines["rows"]] == ["elimination", "CMIM", "top-k", "random"]
    (missing,) = study["left_out"]
    assert missing["name"] == "pruning"
    assert "--never is not for --streams" in refusal("evaluate", grasps, "--streams", "--never", "s0")
