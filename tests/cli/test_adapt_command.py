import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build, verify
from thenar.compiler.samples import select_inputs
from thenar.runtime.build import Build
from thenar.runtime.model.terms.base import HIGHEST_CODE

from ..sets import grasp_set_of
from .conftest import refusal, thenar, works

TYPES = ("cup", "pen", "rod")
# Runs a command without the packages of the extras.
BARE = (
    "import sys; sys.modules |= dict.fromkeys(('scipy', 'sklearn', 'jinja2', 'matplotlib', 'joblib'));"
    "from thenar.cli import run; sys.exit(run(sys.argv[1:]))"
)


def recorded(people: dict[str, int], trials: int = 30) -> GraspSet:
    """Return trials of people, each with a seed: a hand moves what each type closes, and where the joints are."""
    labels, switches, codes = np.arange(trials) % 3, [], []
    for seed in people.values():
        hand, random = np.random.default_rng(seed), np.random.default_rng([seed, 1])
        centres = np.array([[60, 90], [120, 70], [100, 160]]) + hand.integers(-35, 36, (3, 2))
        closed = np.array([[0, 0, 1, 1, 0, 1], [0, 1, 0, 1, 1, 0], [1, 0, 0, 1, 1, 1]], bool)
        closed ^= hand.random((3, 6)) < 0.2
        switches.append(closed[labels] ^ (random.random((trials, 6)) < 0.12))
        codes.append(np.clip(centres[labels] + random.integers(-15, 16, (trials, 2)), 0, 255))
    columns = {"switches": np.vstack(switches), "codes": np.vstack(codes), "subjects": np.repeat([*people], trials)}
    return grasp_set_of(TYPES, np.tile(labels, len(people)), **columns)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("wearer")
    crowd = recorded({f"P{seed}": seed for seed in range(5)})
    crowd.save(place / "crowd.grasps")
    compile_build(crowd, place / "build", trainer="logit", penalty=1.0, smoothness=4.0, max_bins=8, jobs=1)
    mine = recorded({"me": 77}, 126)
    mine.rows(np.arange(6)).save(place / "mine.grasps")
    mine.rows(np.arange(6, 126)).save(place / "later.grasps")
    assert thenar("adapt", place / "build", place / "mine.grasps", "-o", place / "mine").returncode == 0
    return place


def test_own_trials_raise_the_accuracy_of_later_ones(folder: Path) -> None:
    later = GraspSet.load(folder / "later.grasps")
    before, after = (verify(folder / build, later) for build in ("build", "mine"))
    assert after.holds
    assert after.recognised[0].rate > before.recognised[0].rate + 0.05
    assert before.trained_on == after.trained_on
    assert verify(folder / "mine", GraspSet.load(folder / "mine.grasps")).trained_on == 6


def test_the_adapted_build_reads_what_the_other_does(folder: Path) -> None:
    one, other = Build.load(folder / "build"), Build.load(folder / "mine")
    assert other.manifest.switches == one.manifest.switches
    assert other.manifest.joints == one.manifest.joints
    adapted = other.manifest.adapted
    assert adapted is not None
    assert (adapted.build, adapted.counts, adapted.source.rows) == (one.manifest.checksum, (2, 2, 2), 6)
    left_out = {rate.of: rate for rate in one.manifest.rates if rate.protocol == "nested"}
    assert left_out["new subject after adaptation"].total == 120
    assert left_out["new subject after adaptation"].rate > left_out["new subject"].rate
    core = {path.name: path.read_bytes() for path in (folder / "build" / "firmware").iterdir()}
    changed = {name for name, data in core.items() if (folder / "mine" / "firmware" / name).read_bytes() != data}
    assert changed == {"thenar_glove.h", "thenar_glove.c"}


def test_the_wearers_frames_are_not_refused(folder: Path) -> None:
    said = works("run", folder / "mine", "--replay", folder / "mine.grasps")
    assert '"none"' not in said.stdout
    limits = Build.load(folder / "mine").manifest.rejection
    assert limits is not None
    mine = GraspSet.load(folder / "mine.grasps")
    low, high = np.moveaxis(np.array(limits.ranges), 2, 0)[:, mine.labels]
    assert ((mine.codes >= low) & (mine.codes <= high) & (high <= HIGHEST_CODE)).all()


def test_what_is_printed(folder: Path, tmp_path: Path) -> None:
    said = thenar("adapt", folder / "build", folder / "mine.grasps", "-o", tmp_path / "mine")
    lines = said.stdout.splitlines()
    assert lines[0] == f"{tmp_path}/mine: adapted to 6 trials of 3 types"
    after = Build.load(tmp_path / "mine").manifest.headline
    assert after is not None
    assert f"{100 * after.rate:.1f} % after, each by a build adapted to all others" in lines[1]
    assert "must be the build of everybody" in thenar(*said.args[:1], folder / "mine", *said.args[2:]).stderr


def test_the_base_dependencies_suffice_and_give_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    arguments = ["adapt", str(folder / "build"), str(folder / "mine.grasps"), "-o", str(tmp_path / "mine")]
    done = subprocess.run([sys.executable, "-c", BARE, *arguments], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert 'no firmware: pip install "thenar[compiler]"' in done.stdout
    assert not (tmp_path / "mine" / "firmware").exists()
    assert not (tmp_path / "mine" / "report.html").exists()
    for name in ("build.json", "tables.bin", "ensemble.bin"):
        assert (tmp_path / "mine" / name).read_bytes() == (folder / "mine" / name).read_bytes()


def test_types_may_be_missing_and_contradictions_are_named(folder: Path, tmp_path: Path) -> None:
    mine = GraspSet.load(folder / "mine.grasps")
    same = mine.rows(np.array([0, 0]))
    both = grasp_set_of(TYPES, [0, 1], switches=same.switches, codes=same.codes)
    both.save(tmp_path / "two.grasps")
    said = works("adapt", folder / "build", tmp_path / "two.grasps", "-o", tmp_path / "new")
    assert "a frame is the same for cup, pen, in trials 0, 1:" in said.stderr
    assert "no trials of rod" in said.stderr
    # Even a frame that looks like another type is within the limits of its own.
    build = Build.load(tmp_path / "new")
    limits = build.manifest.rejection
    assert limits is not None
    scores = build.tables.scores(*select_inputs(both, build.manifest))
    assert (scores[[0, 1], [0, 1]] >= limits.least_scores[:2]).all()


def test_a_type_is_added_by_name(folder: Path, tmp_path: Path) -> None:
    mine = GraspSet.load(folder / "mine.grasps")
    switches, codes = np.vstack([mine.switches, mine.switches[:3]]), np.vstack([mine.codes, np.full((3, 2), 250)])
    trials = grasp_set_of((*TYPES, "vase"), [0, 1, 2, 0, 1, 2, 3, 3, 3], switches=switches, codes=codes)
    trials.save(tmp_path / "vase.grasps")
    arguments = ("adapt", folder / "build", tmp_path / "vase.grasps", "-o", tmp_path / "new")
    reason = refusal(*arguments)
    assert "the build does not know vase" in reason
    assert "or teach new types with --add-type" in reason
    said = works(*arguments, "--add-type", "vase")
    assert "adapted to 9 trials of 4 types; added: vase" in said.stdout
    assert Build.load(tmp_path / "new").grasps == (*TYPES, "vase")
    assert thenar("verify", tmp_path / "new", tmp_path / "vase.grasps", "--firmware", "host").stdout.endswith("holds\n")
    core = {path.name: path.read_bytes() for path in (folder / "build" / "firmware").iterdir()}
    changed = {name for name, data in core.items() if (tmp_path / "new" / "firmware" / name).read_bytes() != data}
    assert changed == {"thenar_glove.h", "thenar_glove.c"}


def test_a_lost_inputs_substitute_moves_with_its_mean_contribution(folder: Path) -> None:
    one, other = (Build.load(folder / name).tables for name in ("build", "mine"))
    bits = select_inputs(GraspSet.load(folder / "mine.grasps"), Build.load(folder / "mine").manifest)[0]
    share, rows = bits.mean(axis=0)[:, np.newaxis], other.switch_rows
    apart = [(each.switch_means - share * each.switch_rows) / each.scale for each in (one, other)]
    # Bytes hold it in steps, inside of the range of what a switch adds.
    means, step = other.switch_means.astype(int), 1 << other.missing_shifts[: other.n_switches, np.newaxis]
    inside = (means - step >= np.minimum(rows, 0)) & (means + step <= np.maximum(rows, 0))
    assert inside.any()
    beyond = np.abs(apart[1] - apart[0]) > (step / 2 + 1) / other.scale
    assert not beyond[inside].any()


def test_unsuitable_recordings_are_refused(folder: Path, tmp_path: Path) -> None:
    mine = GraspSet.load(folder / "mine.grasps")
    strange = {
        "foreign": (grasp_set_of(("cup", "vase"), [1], switches=mine.switches[:1], codes=mine.codes[:1]), "know vase"),
        "empty": (mine.rows(np.arange(0)), "no trials to adapt to"),
        "fewer": (grasp_set_of(TYPES, [1], switches=mine.switches[:1]), "lack 2 inputs of the build"),
    }
    for name, (grasp_set, message) in strange.items():
        grasp_set.save(tmp_path / f"{name}.grasps")
        assert message in refusal("adapt", folder / "build", tmp_path / f"{name}.grasps", "-o", tmp_path / "new"), name
        assert not (tmp_path / "new").exists()


def test_people_left_out_are_adapted_to(folder: Path) -> None:
    options = ("--by", "subject", "--adapt", "1,2", "--trainer", "logit", "--max-bins", 8, "--jobs", 1)
    said = works("evaluate", folder / "crowd.grasps", *options)
    assert "new subject, after 2 own trials a type" in said.stdout
    assert "120 trials of 5 people" in said.stdout
    found = json.loads(thenar("evaluate", folder / "crowd.grasps", *options, "--json").stdout)
    means = [row["mean"] for row in found["rows"]]
    assert [row["own"] for row in found["rows"]] == [0, 1, 2]
    assert means[2] > means[0]
    said = thenar("evaluate", folder / "crowd.grasps", "--adapt", "1")
    assert "give --by subject" in said.stderr
