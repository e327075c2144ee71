import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.importer import import_file
from thenar.compiler.recordings.summary import check_trials, looks_like_frames

from ...conftest import calls, peak_bytes
from ...sets import grasp_set_of

COLUMNS = Path(__file__).resolve().parents[3] / "examples" / "columns"


def make(
    trials: int = 6,
    frames: int = 1,
    hold: float = 2.0,
    drift: float = 0.0,
    types: int = 3,
    subjects: int = 2,
    n_switches: int = 8,
    n_joints: int = 3,
    seed: int = 1,
) -> GraspSet:
    """Joints differ by 20 codes between trials, by `hold` between frames, and wander by `drift` from trial to trial."""
    random = np.random.default_rng(seed)
    shape = (subjects, types, trials, frames, n_joints)
    wander = np.cumsum(random.normal(0, drift, (*shape[:3], 1, n_joints)), axis=2)
    joints = random.uniform(300, 700, (*shape[:2], 1, 1, n_joints)) + wander
    joints = joints + random.normal(0, 20, (*shape[:3], 1, n_joints)) + random.normal(0, hold, shape)
    likely = random.uniform(0.1, 0.9, (subjects, types, 1, n_switches))
    closed = random.random((subjects, types, trials, n_switches)) < likely
    rows = subjects * types * trials * frames
    return grasp_set_of(
        [f"type {number}" for number in range(types)],
        np.tile(np.repeat(np.arange(types), trials * frames), subjects),
        switches=np.repeat(closed.reshape(rows // frames, n_switches), frames, axis=0),
        codes=np.clip(joints, 0, 1023).reshape(rows, n_joints),
        joints=tuple(Joint(f"j{number}", "deg", 0, 0.0, 200, 100.0) for number in range(n_joints)),
        subjects=np.repeat([f"p{number}" for number in range(subjects)], rows // subjects),
        trials=np.tile(np.repeat(np.arange(trials), frames), subjects * types),
    )


def misnamed(grasp_set: GraspSet, by: str) -> GraspSet:
    """Frames that count as trials: the row's number, or the frame's within its trial, as the trial's number."""
    ids = grasp_set.trial_ids
    starts = np.flatnonzero(np.diff(ids, prepend=-1))
    numbers = np.arange(len(ids)) - (0 if by == "row" else starts[ids])
    return replace(grasp_set, trials=numbers)


@pytest.mark.parametrize("by", ["row", "frame"])
@pytest.mark.parametrize("frames", [2, 3, 8, 15, 50])
def test_frames_that_count_as_trials_are_found_whatever_their_number_is_called(frames: int, by: str) -> None:
    right = make(frames=frames)
    assert looks_like_frames(right) is None
    found = looks_like_frames(misnamed(right, by))
    assert found is not None
    assert "look like frames of fewer trials" in found


@pytest.mark.parametrize("n_switches", [0, 30])
def test_switches_alone_and_joints_alone_give_frames_away(n_switches: int) -> None:
    assert looks_like_frames(misnamed(make(frames=5, n_switches=n_switches, n_joints=0 if n_switches else 3), "row"))


def test_slow_holds_and_copies_are_found() -> None:
    assert looks_like_frames(misnamed(make(frames=10, hold=0.5), "row"))
    assert looks_like_frames(misnamed(make(frames=10, hold=0.0), "row"))
    copies = looks_like_frames(misnamed(make(trials=1, frames=10, hold=0.0), "row"))
    assert copies is not None
    assert "copies of fewer trials" in copies


def test_a_scene_without_noise_repeats_itself_and_is_no_copy() -> None:
    copies = misnamed(make(trials=1, frames=10, hold=0.0), "row")
    assert looks_like_frames(replace(copies, simulated="scene still, seed 1")) is None


@pytest.mark.parametrize("seed", range(20))
def test_repetitions_are_not_taken_for_frames(seed: int) -> None:
    for trials in (1, 2, 3, 4, 12, 50):
        for drift in (0.0, 5.0):
            assert looks_like_frames(make(trials=trials, drift=drift, seed=seed)) is None
    for few in ({"n_joints": 0, "n_switches": 2}, {"n_joints": 1, "n_switches": 0}, {"n_joints": 0, "n_switches": 1}):
        assert looks_like_frames(make(trials=30, seed=seed, **few)) is None


def test_frames_in_which_nothing_is_held_are_not_taken_for_trials() -> None:
    frames = misnamed(make(frames=15), "row")
    assert looks_like_frames(frames)
    assert not looks_like_frames(replace(frames, grasps=np.full(len(frames), "none")))


def test_what_never_varies_and_what_is_hardly_there_says_nothing() -> None:
    grasp_set = make(trials=20)
    still = replace(grasp_set, switches=np.ones_like(grasp_set.switches), codes=np.full_like(grasp_set.codes, 7))
    assert looks_like_frames(still) is None
    for rows in (0, 1, 2, 3):
        assert looks_like_frames(grasp_set.rows(np.arange(rows))) is None


@pytest.mark.parametrize("wrong", [False, True])
def test_ten_times_the_rows_make_no_more_calls(wrong: bool) -> None:
    few, many = (make(trials=trials, frames=10, types=10, subjects=1, n_switches=160) for trials in (20, 200))
    if wrong:
        few, many = misnamed(few, "row"), misnamed(many, "row")
    assert bool(looks_like_frames(many)) == wrong
    assert calls(lambda: looks_like_frames(many)) == calls(lambda: looks_like_frames(few))
    assert peak_bytes(lambda: looks_like_frames(many)) < 12 * peak_bytes(lambda: looks_like_frames(few))


def test_the_refusal_names_both_remedies_and_the_claim_silences_it() -> None:
    wrong = misnamed(make(frames=8), "row")
    with pytest.raises(EvaluationError, match=r'trial = "\.\.\." in columns\.toml') as refusal:
        check_trials(wrong, EvaluationError)
    assert 'frames = "independent"' in str(refusal.value)
    check_trials(replace(wrong, independent=True), EvaluationError)


def test_public_sets_of_single_rows_are_not_taken_for_frames(icub_table: Path, aml_table: Path) -> None:
    # The iCub's touches have 230 single grasps; AML's rows are medians of a recording each, as their READMEs say.
    assert looks_like_frames(import_file(icub_table, COLUMNS / "icub.toml")[0]) is None
    assert looks_like_frames(import_file(aml_table, COLUMNS / "aml.toml")[0]) is None


@pytest.fixture(scope="module")
def apertures(r2g_table: Path) -> GraspSet:
    """29 adults, 12 frames a trial: blocks of one hand and one action, in which neighbouring trials are alike."""
    return import_file(r2g_table, COLUMNS / "r2g.toml")[0]


@pytest.mark.slow
def test_real_frames_are_found_and_real_trials_in_blocks_are_none(apertures: GraspSet) -> None:
    assert apertures.trial_ids.max() + 1 == 1370
    assert looks_like_frames(apertures) is None
    assert looks_like_frames(misnamed(apertures, "row"))
    assert looks_like_frames(apertures.rows(np.unique(apertures.trial_ids, return_index=True)[1])) is None


@pytest.mark.slow
def test_real_frames_in_random_folds_leak_and_persons_apart_show_it(apertures: GraspSet) -> None:
    leaks = runpy.run_path(str(COLUMNS.parents[1] / "benchmarks" / "leaks.py"))["rates"](apertures)
    frames = {name.split()[0]: both[1] for name, both in leaks.items()}
    trials = {name.split()[0]: both[0] for name, both in leaks.items()}
    assert frames["frames"].mean == pytest.approx(0.995, abs=0.003)
    assert frames["persons"].mean == pytest.approx(0.80, abs=0.005)
    assert trials["persons"].what == "new subject, trials"
    assert trials["persons"].over == 29
    assert frames["persons"].high < trials["trials"].low < frames["frames"].low
    # The interval over persons is over twice as wide as one of frames that each count for themselves.
    alone = Rate.counted(frames["persons"].correct, frames["persons"].total, of="new subject")
    assert frames["persons"].high - frames["persons"].low > 2.2 * (alone.high - alone.low)
