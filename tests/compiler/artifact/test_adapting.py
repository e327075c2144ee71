"""Builds of one person, from recordings and from arrays, with types that nobody else has."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import Build, GraspSet, adapt, compile_build, verify
from thenar.compiler.artifact import CompileError
from thenar.compiler.recordings import RecordingError
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.taxonomy import own, tasks_of
from thenar.compiler.samples import select_inputs
from thenar.compiler.wearer_study import study_wearers
from thenar.runtime.model.integers import MAX_CLASSES
from thenar.runtime.recipe import Recipe, changed

from ...sets import grasp_set_of
from .test_none import moving

TYPES = ("cup", "pen", "rod", "tin")
SETTINGS = {"linear": {"penalty": 1.0}, "logit": {"penalty": 1.0, "smoothness": 4.0}}


def recorded(people: int, trials: int, seed: int = 1, frames: int = 2) -> GraspSet:
    """Return trials of people with a switch, two pads and a joint, most of which tell each type."""
    random, n = np.random.default_rng(seed), people * trials * frames
    labels = np.repeat(np.tile(np.arange(trials) % 4, people), frames)
    coded = tuple(Joint(name, "deg", 0, 0.0, 255, 127.5) for name in ("pad1", "pad2", "bend", "tilt"))
    centres = np.array([[40, 40, 60, 200], [200, 40, 120, 60], [40, 200, 200, 120], [200, 200, 60, 60]])
    codes = np.clip(centres[labels] + random.normal(0, 25, (n, 4)), 0, 255).astype(np.uint16)
    return grasp_set_of(
        TYPES,
        labels,
        switches=(labels == 2)[:, np.newaxis] ^ (random.random((n, 1)) < 0.1),
        codes=codes[:, 2:],
        joints=coded[2:],
        taxels=codes[:, :2],
        taxel_columns=coded[:2],
        subjects=np.repeat([f"P{person}" for person in range(people)], trials * frames),
        trials=np.tile(np.repeat(np.arange(trials), frames), people),
    )


@pytest.fixture(scope="module", params=SETTINGS)
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A build of three of the types."""
    place, crowd = tmp_path_factory.mktemp("adapting"), recorded(4, 24)
    settings = {"trainer": request.param, **SETTINGS[request.param]}
    compile_build(crowd.rows(crowd.grasps != "rod"), place / "build", keep=3, placement="cmim", jobs=1, **settings)
    return place


def test_a_type_that_nobody_else_has_is_taught_by_three_trials(folder: Path, tmp_path: Path) -> None:
    mine, later = recorded(1, 12, seed=5), recorded(1, 80, seed=6)
    made = adapt(folder / "build", mine, output=tmp_path / "mine", add_type=["rod"])
    old, build = Build.load(folder / "build"), Build.load(tmp_path / "mine")
    assert build.grasps == ("cup", "pen", "tin", "rod")
    adapted = made.manifest.adapted
    assert adapted is not None
    assert (made.after, adapted.counts, adapted.added) == (12, (3, 3, 3, 3), ("rod",))
    assert made.by_type[3] == (3, 0, 3)
    assert [sum(column) for column in zip(*made.by_type, strict=True)] == [12, made.before, made.after]
    # Its report is of itself: of the person's trials.
    page = (tmp_path / "mine" / "report.html").read_text()
    assert build.manifest.checksum in page
    assert f"{made.after} of 12 trials" in page
    assert f"Firmware</dt><dd>{made.firmware}" in page.replace("\n", "")
    assert "12 nested folds" in page.partition('id="confusion"')[2]
    found = verify(tmp_path / "mine", later)
    assert found.holds
    known = later.grasps != "rod"
    before, after = (verify(folder_, later.rows(known)) for folder_ in (folder / "build", tmp_path / "mine"))
    assert after.recognised[0].rate > before.recognised[0].rate - 0.05
    assert verify(tmp_path / "mine", later.rows(~known)).recognised[0].rate > 0.85
    # The limits of the new type are no narrower than those of any other, and all trials are within theirs.
    limits, others = build.manifest.rejection, old.manifest.rejection
    assert limits is not None
    assert others is not None
    bits, codes = select_inputs(mine, build.manifest)
    low, high = np.moveaxis(np.array(limits.ranges)[3], 1, 0)
    assert (low <= np.array(others.ranges)[:, :, 0]).all()
    assert (high >= np.array(others.ranges)[:, :, 1]).all()
    labels = np.array([build.grasps.index(grasp) for grasp in mine.grasps.tolist()])
    assert (
        build.tables.scores(bits, codes)[np.arange(len(labels)), labels] >= np.array(limits.least_scores)[labels]
    ).all()
    # How often the switches are closed in its trials.
    for switch, closed, pattern in zip(
        build.manifest.switches, bits[labels == 3].T, old.manifest.switches, strict=True
    ):
        shares = [np.frombuffer(bytes.fromhex(text), np.uint8) for text in (switch.closed_least, switch.closed_most)]
        count = sum(closed.reshape(3, 2).sum(axis=1) >= 1)
        assert shares[0][3] <= 255 * (count + 0.5) / 4 <= shares[1][3]
        assert switch.closed_least[:6] == pattern.closed_least


def test_arrays_make_the_build_that_recordings_make(folder: Path, tmp_path: Path) -> None:
    mine = recorded(1, 12, seed=5)
    X = np.hstack([*select_inputs(mine, Build.load(folder / "build").manifest)])
    adapt(folder / "build", mine, output=tmp_path / "one", add_type=["rod"])
    names, output = mine.grasps.tolist(), tmp_path / "other"
    adapt(folder / "build", X.tolist(), names, output=output, trials=mine.trials, add_type=("rod",))
    for name in ("tables.bin", "ensemble.bin"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()
    one, other = (Build.load(tmp_path / name).manifest for name in ("one", "other"))
    assert (one.rates, one.rejection, one.switches) == (other.rates, other.rejection, other.switches)
    # Nothing held is left out, as this build does not know it.
    more, trials = np.vstack([X, X[:1]]), np.append(mine.trials, 0)
    adapt(folder / "build", more, [*names, "none"], output=tmp_path / "more", trials=trials, add_type=("rod",))
    assert (tmp_path / "one" / "tables.bin").read_bytes() == (tmp_path / "more" / "tables.bin").read_bytes()


def test_wrong_types_and_arrays_are_named(folder: Path, tmp_path: Path) -> None:
    mine = recorded(1, 12, seed=5)
    few = mine.rows(mine.grasps != "rod")
    X = np.hstack([*select_inputs(few, Build.load(folder / "build").manifest)])
    wrong = (
        (mine, None, (), CompileError, "does not know rod .*, or teach new types with ``add_type``"),
        (mine, None, ("rod", "rod"), CompileError, "rod is no new type"),
        (few, None, ("cup",), CompileError, "cup is no new type: leave it out of ``add_type``"),
        (few, None, ("none",), CompileError, "none is no new type"),
        (few, None, ("rod",), CompileError, "no trials of rod to teach it with: record three"),
        (
            few,
            None,
            [f"t{number}" for number in range(MAX_CLASSES - 2)],
            CompileError,
            "1025 grasp types, a build has",
        ),
        (X[:, :2], few.grasps, (), CompileError, r"X has shape \(18, 2\): it needs a row for each of the 18 names"),
        (X, few.grasps[:4], (), CompileError, "each of the 4 names in y"),
        (
            X,
            None,
            (),
            CompileError,
            "each of the 0 names in y, and a column for each of the build's 3 switches, then 2",
        ),
        (X + 2, few.grasps, (), RecordingError, "switches holds numbers that do not fit into bool"),
        (X * 1000, few.grasps, (), RecordingError, "do not fit"),
    )
    for trials, y, added, error, message in wrong:
        with pytest.raises(error, match=message):
            adapt(folder / "build", trials, y, output=tmp_path / "mine", add_type=added)
    assert not (tmp_path / "mine").exists()


def test_types_without_own_trials_are_named_where_others_are_added(folder: Path, tmp_path: Path) -> None:
    mine = recorded(1, 12, seed=5)
    alone = adapt(folder / "build", mine.rows(mine.grasps == "rod"), output=tmp_path / "mine", add_type=["rod"])
    assert alone.warnings[-1] == "no trials of cup, pen, tin: some may be taken for rod"
    assert verify(tmp_path / "mine", mine).holds


@pytest.mark.parametrize("knows_none", [True, False])
def test_a_taught_type_has_costs_of_segments_and_comes_before_nothing_held(tmp_path: Path, knows_none: bool) -> None:
    everything = moving()
    crowd = everything.rows(everything.grasps != "hook")
    crowd = crowd if knows_none else crowd.without_none()
    # Few switches tell the other types apart, but all may tell the new one.
    recipe = Recipe(trainer="logit", keep=9, placement="cmim", folds=2, settings={"penalty": 1.0, "smoothness": 2.0})
    compile_build(crowd, tmp_path / "build", recipe, jobs=1)
    mine = everything.rows((everything.subjects == "S0") & (everything.trials < 3))
    adapt(tmp_path / "build", mine, output=tmp_path / "mine", add_type=["hook"])
    build = Build.load(tmp_path / "mine")
    assert build.grasps == ("pinch", "disk", "hook", "none")[: 3 + knows_none]
    found = verify(tmp_path / "mine", everything, firmware=["host"])
    assert found.holds
    assert found.recognised[0].rate > 0.9
    segments, old = build.manifest.segments, Build.load(tmp_path / "build").manifest.segments
    assert (segments is None) == (not knows_none)
    if segments is not None and old is not None:
        assert (segments.n_types, segments.least[2] in old.least[:2]) == (3, True)
        assert (*segments.least[:2], segments.least[3]) == old.least


def test_the_tasks_of_a_build_are_its_types_and_those_to_add(folder: Path) -> None:
    manifest = Build.load(folder / "build").manifest
    types, tasks = tasks_of(manifest, ("rod", "my own"))
    assert types == own(["cup", "pen", "tin", "rod", "my own"])
    assert [task.grasp for task in tasks] == [*types.types]
    assert tasks_of(manifest)[0].types == ("cup", "pen", "tin")
    for name in ("cup", "none"):
        with pytest.raises(RecordingError, match=f"grasp type '{name}' occurs twice"):
            tasks_of(manifest, (name,))


def test_evaluate_finds_what_compile_states(tmp_path: Path) -> None:
    crowd = recorded(5, 32, seed=9)
    person = np.array([int(name[1:]) for name in crowd.subjects])
    crowd = replace(
        crowd, codes=np.clip(crowd.codes + (person[:, np.newaxis] - 2) * [25, -20], 0, 255).astype(np.uint16)
    )
    recipe = changed(Recipe(inputs="joints"), {"trainer": "linear", "penalty": 1.0})
    rates = compile_build(crowd, tmp_path / "build", recipe, jobs=1).manifest.rates
    stated = next(rate for rate in rates if rate.of == "new subject after adaptation")
    row = study_wearers(crowd, recipe, (2,), 1).rows[0]
    assert sum(row.people) == pytest.approx(5 * stated.rate)


@pytest.mark.parametrize("width", [4, 16])
def test_evaluate_counts_the_tables_that_adapt_deploys(tmp_path: Path, width: int) -> None:
    """With one other person no strength is chosen; frames that are refused count by their scores."""
    crowd = recorded(2, 60, seed=9, frames=1)
    recipe = changed(Recipe(inputs="joints", width=width), {"trainer": "logit", **SETTINGS["logit"]})
    study = study_wearers(crowd, recipe, (2,), 1).rows[0]
    for person, found in zip(("P0", "P1"), study.people, strict=True):
        mine = crowd.rows(crowd.subjects == person)
        compile_build(crowd.rows(crowd.subjects != person), tmp_path / f"of-{person}", recipe, jobs=1)
        adapt(tmp_path / f"of-{person}", mine.rows(mine.trials < 8), output=tmp_path / person)
        build, later = Build.load(tmp_path / person), mine.rows(mine.trials >= 8)
        bits, codes = select_inputs(later, build.manifest)
        predicted = np.array(build.grasps)[build.tables.scores(bits, codes).argmax(axis=1)]
        assert found == np.mean(predicted == later.grasps)
