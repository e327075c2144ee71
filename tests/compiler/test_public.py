"""`from thenar.compiler import ...`: every name is there, is documented, and does what its example says."""

import doctest
import inspect
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from sklearn.compose import ColumnTransformer
from sklearn.feature_selection import SelectKBest, VarianceThreshold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import thenar.compiler
import thenar.runtime
from thenar.compiler import (
    AdditiveLogitClassifier,
    Build,
    CompileError,
    GraspSet,
    LogitBoostClassifier,
    Samples,
    SwitchSelector,
    compile,  # noqa: A004
    compile_build,
    export_c,
    verify,
)
from thenar.runtime.errors import ThenarError

from .conftest import make_set

NAMES = [name for name in thenar.compiler.__all__ if callable(getattr(thenar.compiler, name))]
WITH_EXAMPLES = [name for name in NAMES if ">>>" in (getattr(thenar.compiler, name).__doc__ or "")]


def test_every_name_is_listed_once_and_loads() -> None:
    assert dir(thenar.compiler) == sorted(thenar.compiler.__all__)
    assert all(getattr(thenar.compiler, name) is not None for name in thenar.compiler.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = thenar.compiler.nothing


def test_rooms_say_which_thenar_they_are_of() -> None:
    assert thenar.compiler.__version__ == thenar.runtime.__version__ == version("thenar")


@pytest.mark.parametrize("name", NAMES)
def test_every_name_says_what_it_takes(name: str) -> None:
    public = getattr(thenar.compiler, name)
    words = inspect.getdoc(public) or ""
    assert words.split("\n")[0].endswith(".")
    if inspect.isfunction(public):
        assert "Parameters\n----------" in words
        assert "Raises\n------" in words


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_every_example_does_what_it_says(
    name: str, grasp_set: GraspSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    grasp_set.save(tmp_path / "set.grasps")
    failures: list[str] = []
    runner = doctest.DocTestRunner()
    (test,) = doctest.DocTestFinder(recurse=False).find(getattr(thenar.compiler, name), name, globs={})
    assert runner.run(test, out=failures.append).failed == 0, "".join(failures)


@pytest.fixture(name="X")
def inputs_of_all_rows(grasp_set: GraspSet) -> np.ndarray:
    return Samples.of(grasp_set).inputs


def test_a_fitted_classifier_becomes_a_build_that_answers_as_it_does(
    grasp_set: GraspSet, X: np.ndarray, tmp_path: Path
) -> None:
    classifier = LogitBoostClassifier(rounds=5, shrinkage=0.5, max_bins=4).fit(X, grasp_set.grasps)
    made = compile(classifier, grasp_set, tmp_path / "made", folds=2)
    options = made.manifest.options
    assert len(made.manifest.switches) == len(grasp_set.switch_names)
    assert (options.rounds, options.shrinkage, options.max_bins) == (5, 0.5, 4)
    assert [rate.protocol for rate in made.manifest.rates] == ["training", "nested"]
    assert verify(tmp_path / "made", grasp_set).holds
    build = Build.load(tmp_path / "made")
    frames = zip(grasp_set.switches, grasp_set.codes, strict=True)
    answers = [build.grasps[int(build.scores(*frame).argmax())] for frame in frames]
    assert np.mean(np.array(answers) == classifier.predict(X)) > 0.98


def test_an_additive_logit_becomes_a_build_of_the_columns_that_it_gets(
    grasp_set: GraspSet, X: np.ndarray, tmp_path: Path
) -> None:
    s = len(grasp_set.switch_names)
    chosen = ColumnTransformer([("codes", "passthrough", slice(s, None)), ("switches", SelectKBest(k=5), slice(s))])
    classifier = AdditiveLogitClassifier(penalty=0.7, max_bins=None)
    pipeline = make_pipeline(chosen, classifier).fit(X, grasp_set.grasps)
    made = compile(pipeline, grasp_set, tmp_path / "made", folds=2)
    options = made.manifest.options
    assert (options.trainer, options.max_bins, options.settings) == ("logit", 65536, {"penalty": 0.7, "smoothness": 2})
    assert len(made.manifest.switches) == 5
    found = verify(tmp_path / "made", grasp_set)
    assert found.holds
    assert found.recognised[0].ensemble == np.count_nonzero(pipeline.predict(X) == grasp_set.grasps)


@pytest.mark.parametrize("subjects", [1, 3])
def test_a_pipeline_and_compile_build_make_the_same_papers_recipe(tmp_path: Path, subjects: int) -> None:
    grasp_set = make_set(subjects=subjects, frames=2)
    X = Samples.of(grasp_set).inputs
    switches = slice(0, len(grasp_set.switch_names))
    chosen = ColumnTransformer([("switches", SwitchSelector("id3", min_samples=5), switches)], remainder="passthrough")
    pipeline = make_pipeline(chosen, LogitBoostClassifier(rounds=4)).fit(X, grasp_set.labels)
    made = compile(pipeline, grasp_set, tmp_path / "made", folds=3).manifest
    same = compile_build(grasp_set, tmp_path / "same", prune=5, rounds=4, folds=3).manifest
    assert made.options == same.options
    assert made.rates == same.rates
    assert [rate.of for rate in made.rates if rate.unit == "trials"][1:] == (
        ["within subject"] if subjects == 1 else ["new subject", "pooled", "new subject after adaptation"]
    )
    assert sorted(made.switches, key=lambda switch: switch.column) == sorted(
        same.switches, key=lambda switch: switch.column
    )


def test_what_is_no_sum_over_these_columns_is_refused(grasp_set: GraspSet, X: np.ndarray, tmp_path: Path) -> None:
    few = LogitBoostClassifier(rounds=2).fit(X[:, :3], grasp_set.grasps)
    scaled = make_pipeline(StandardScaler(), LogitBoostClassifier(rounds=2)).fit(X, grasp_set.grasps)
    strange = LogitBoostClassifier(rounds=2).fit(X, np.full(len(X), "thing"))
    bare = VarianceThreshold().fit(X)
    bare.classes_ = np.unique(grasp_set.grasps)
    for estimator, because in (
        (few, "was fitted on 3 columns"),
        (scaled, "must select columns"),
        (strange, "the estimator does not know"),
        (bare, "has no model that is a sum"),
    ):
        with pytest.raises(CompileError, match=because):
            compile(estimator, grasp_set, tmp_path / "build")
    assert not (tmp_path / "build").exists()


def test_a_build_is_written_as_c(grasp_set: GraspSet, tmp_path: Path) -> None:
    compile_build(grasp_set, tmp_path / "build", rounds=3, folds=0)
    build = Build.load(tmp_path / "build")
    written = export_c(build, tmp_path / "c", "avr328p")
    assert set(written) == {*(tmp_path / "c").iterdir()} - {tmp_path / "c" / "SHA256SUMS"}
    with pytest.raises(ThenarError):
        export_c(build, tmp_path / "c", "avr328p")
    assert export_c(build, tmp_path / "c", "avr328p", overwrite=True) == written
