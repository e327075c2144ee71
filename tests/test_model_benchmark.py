"""`benchmarks/models.py` on a small simulated set: folds, what is stored, and what a peer's answers are read from."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import simulate

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(scope="module", autouse=True)
def on_path() -> None:
    if str(BENCHMARKS) not in sys.path:
        sys.path.append(str(BENCHMARKS))


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("set") / "few.grasps"
    simulate(load_scene("quick").varied(8, 1), jobs=1).grasp_set.save(path)
    return path


def test_no_fold_splits_a_trial_or_a_left_out_subject(grasps: Path) -> None:
    from modelsets import cuts, load

    found = list(cuts(load(str(grasps), Path())))
    assert [cut.of for cut in found] == ["pooled"] * 4 + ["new subject"] * 2
    for cut in found:
        assert not set(cut.train.trials) & set(cut.test.trials)
        assert cut.of == "pooled" or not set(cut.train.subjects) & set(cut.test.subjects)
        assert cut.train.n_switches == cut.test.n_switches <= 33
        for fold in cut.inner():
            assert not set(cut.groups[fold.train]) & set(cut.groups[fold.test])
            assert len(fold.train) + len(fold.test) == len(cut.groups)


@pytest.mark.slow
def test_our_trainers_their_integers_and_weka_recognise_most_grasps(grasps: Path) -> None:
    from modelpeers import OURS, PEERS, recognised
    from modelsets import cuts, load

    cut = next(cuts(load(str(grasps), Path())))
    for model in (each for each in OURS + PEERS if each.there and (each.ours or each.needs == "java")):
        answers, integers = model.predicted(cut)
        assert recognised(answers, cut.test).mean() > 0.8, model.name
        assert (integers is not None) == model.ours
        assert integers is None or np.mean(answers == integers) > 0.98, model.name


@pytest.mark.slow
def test_a_second_run_prints_the_same_from_what_the_first_one_stored(grasps: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    command = [sys.executable, str(BENCHMARKS / "models.py"), "--sets", str(grasps), "--store", str(store)]
    command += ["--models", "logistic regression", "logitboost"]
    first, second = (subprocess.run(command, capture_output=True, text=True, check=True) for _ in range(2))
    assert len(list(store.rglob("output.pkl"))) == 2 * 6
    assert first.stdout == second.stdout
    assert "12/12" in first.stderr
    assert "0/0" in second.stderr
    for word in ("logistic regression", "logitboost", "new subject", "behind"):
        assert word in first.stdout
