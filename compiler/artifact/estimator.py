"""Turn a fitted scikit-learn estimator into a build, and a build into C."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from thenar.drivers.extras import optional
from thenar.runtime.build import Build
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import HIGHEST_CODE
from thenar.runtime.published import NONE
from thenar.runtime.recipe import By, Inputs, Recipe, TableBits

from ..classifiers import AdditiveLogitClassifier, LogitBoostClassifier
from ..evaluation.folds import Fold
from ..firmware.classifier import LIBRARY_NAME
from ..firmware.generate import firmware_files, write_folder
from ..placement.elements import elements_of
from ..placement.methods.base import METHODS, PAPERS
from ..placement.placement import InputSelection, information_alone
from ..placement.selectors import SwitchSelector
from ..recogniser import Recogniser, Scores
from ..recordings.graspset import GraspSet
from ..recordings.summary import check_trials
from ..samples import Columns, Samples
from ..trainers.base import Model, Report
from ..trainers.logit import ColumnTables
from ..trainers.stumps import Stumps
from . import CompileError
from .compile import BuildAssembly, Wired, check_target
from .documents import BuildReport, Documents
from .ensemble import model_fault
from .training import cross_validated, cuts_of
from .wearers import Hits, hits_of

with optional():
    from sklearn.base import clone

# The score of a class that is absent from a fold's training rows.
_UNSEEN = -1e6


def export_c(
    build: Build,
    folder: str | Path,
    target: str = "avr328p",
    *,
    name: str = LIBRARY_NAME,
    flash: int | None = None,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Write C99 that predicts exactly as a build does into `folder`, and return the files.

    Parameters
    ----------
    build : Build
        The build, loaded.
    folder : path
        The folder to write.
    target : str
        The name of `thenar firmware --target`: one of `TARGETS`.
    name : str
        The prefix of every C name.
    flash : int, optional
        Bytes of flash that the classifier may use; None: three quarters of the part's flash.
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    SettingError
        If there is no such target.
    FirmwareError
        If the build does not fit the target.

    Examples
    --------
    >>> from thenar.compiler import Build, GraspSet, compile_build, export_c
    >>> report = compile_build(GraspSet.load("set.grasps"), "build", rounds=3, folds=0)
    >>> sorted(path.name for path in export_c(Build.load("build"), "firmware", "host"))[:2]
    ['Makefile', 'check.c']
    """
    files = firmware_files(build.tables, build.manifest, target, name, flash)
    write_folder(files, Path(folder), overwrite=overwrite)
    return tuple(Path(folder) / path for path in files)


def compile(  # noqa: A001
    estimator: Any,
    grasp_set: GraspSet,
    folder: str | Path,
    *,
    folds: int = 4,
    seed: int = 1,
    by: By | None = None,
    table_bits: TableBits = 16,
    width: int = 16,
    harness: Wired | None = None,
    documents: Documents | None = None,
    jobs: int = -1,
    progress: Report | None = None,
) -> BuildReport:
    """Write a fitted estimator as a build in `folder`, either completely or not at all.

    Parameters
    ----------
    estimator : LogitBoostClassifier, AdditiveLogitClassifier or Pipeline
        Fitted on X, y = `Samples.of(grasp_set).inputs`, `grasp_set.grasps`. The last step of a pipeline is the
        classifier; the steps before it select columns. Any classifier with `classes_` and its model as `stumps_`
        (Stumps) or `tables_` (ColumnTables; or ScoreTables, switches first) is accepted.
    grasp_set : GraspSet
        The recordings: the build takes names and calibrations from them, and their rows prove its integers.
    folder : path
        The folder to write: new, empty, or a build, which is replaced.
    folds, seed, by
        As in Recipe; folds fit clones of the estimator.
    table_bits, width : int
        As in Recipe.
    harness, documents, jobs
        As in `compile_build`.
    progress : callable, optional
        Called with (done, total) after each fold.

    Returns
    -------
    BuildReport
        Where the build is, and its properties.

    Raises
    ------
    CompileError
        If the estimator was fitted on other columns or labels, changes them, or its model is not a sum over them.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.feature_selection import VarianceThreshold
    >>> from thenar.compiler import GraspSet, LogitBoostClassifier, Samples, compile
    >>> grasp_set = GraspSet.load("set.grasps")
    >>> recogniser = make_pipeline(VarianceThreshold(0.1), LogitBoostClassifier(rounds=5))
    >>> recogniser = recogniser.fit(Samples.of(grasp_set).inputs, grasp_set.grasps)
    >>> compile(recogniser, grasp_set, "build", folds=0).manifest.options.rounds
    5
    """
    target = check_target(Path(folder))
    if grasp_set.taxel_columns:
        raise CompileError(
            "the recordings have taxels, whose thresholds only compile_build learns: import them with fixed thresholds "
            "to use an estimator"
        )
    samples, classifier = Samples.of(grasp_set), _classifier(estimator)
    _columns(estimator, samples.inputs)
    samples = _labelled(samples, grasp_set, classifier.classes_)
    selection, model = _learnt(estimator, samples)
    columns = selection.columns
    inputs: Inputs = "both" if columns and selection.joints else "switches" if columns else "joints"
    options = Recipe(
        inputs=inputs, folds=folds, seed=seed, table_bits=table_bits, width=width, placement="estimator", by=by
    )
    if folds:
        check_trials(grasp_set, CompileError)
    cuts = cuts_of(grasp_set, options)
    options, gains = _placed_by(estimator, _trained_by(classifier, options))
    gains = gains or information_alone(samples.without_none(), columns)
    selection = replace(selection, gains=gains)
    made = BuildAssembly(grasp_set, Recogniser(options, samples, selection, model), harness)
    test = partial(_scores_of, estimator, samples, options)
    tested = cross_validated(samples, cuts, options, test, jobs, progress)
    return made.publish(target, tested, documents, jobs, progress)


def _classifier(estimator: Any) -> Any:
    return estimator[-1] if hasattr(estimator, "steps") else estimator


def _learnt(estimator: Any, samples: Samples) -> tuple[InputSelection, Model]:
    """Return the switches and joints that an estimator uses, and the model that it learned from these samples."""
    columns = _columns(estimator, samples.inputs)
    switches = tuple(column for column in columns if column < samples.n_switches)
    joints = tuple(column - samples.n_switches for column in columns if column >= samples.n_switches)
    classifier = _classifier(estimator)
    model = _model(classifier, columns, samples.n_switches)
    if fault := model_fault(model, len(switches), len(joints), len(classifier.classes_)):
        raise CompileError(f"the estimator has a model that {fault}: fit it on these recordings")
    return InputSelection(elements_of(samples), switches, joints), model


def _columns(estimator: Any, X: NDArray[np.uint16]) -> Columns:
    """Return the columns of X that reach the classifier."""
    fitted = getattr(estimator, "n_features_in_", None)
    if fitted != X.shape[1]:
        raise CompileError(
            f"the estimator was fitted on {fitted or 'no'} columns, the recordings have {X.shape[1]} switches and "
            "joints: fit it on Samples.of(grasp_set).inputs"
        )
    if not hasattr(estimator, "steps") or len(estimator.steps) == 1:
        return tuple(range(X.shape[1]))
    names = list(getattr(estimator, "feature_names_in_", [f"x{number}" for number in range(X.shape[1])]))
    try:
        selected = [str(name).rpartition("__")[2] for name in estimator[:-1].get_feature_names_out(names)]
        columns = tuple(names.index(name) for name in selected)
        same = np.array_equal(np.asarray(estimator[:-1].transform(X)), X[:, list(columns)])
    except (AttributeError, ValueError) as reason:
        raise CompileError(f"the steps before the classifier must select columns: {reason}") from None
    if not same:
        raise CompileError("the steps before the classifier must select columns without changing their values")
    return columns


def _labelled(samples: Samples, grasp_set: GraspSet, classes: NDArray[Any]) -> Samples:
    """Return the samples with the estimator's classes: names of grasp types, or their numbers in the taxonomy."""
    types, numbered = grasp_set.taxonomy.names, classes.dtype.kind in "iu"
    names = [types[number] if numbered and 0 <= number < len(types) else str(number) for number in classes.tolist()]
    if samples.has_none and NONE in names[:-1]:
        raise CompileError(f"the estimator sorts {NONE!r} before {names[-1]!r}: fit it on grasp_set.labels instead")
    unknown = sorted(set(samples.grasps) - set(names))
    if unknown:
        raise CompileError(
            f"the estimator does not know {unknown[0]!r}: fit it with the names of all grasp types as labels"
        )
    labels = np.array([names.index(samples.grasps[label]) for label in samples.labels], dtype=np.intp)
    return replace(samples, labels=labels, grasps=tuple(names))


def _model(classifier: Any, columns: Columns, n_switches: int) -> Model:
    """Return the classifier's model over [switches | joints]."""
    order = sorted(range(len(columns)), key=lambda place: columns[place] >= n_switches)
    tables, stumps = getattr(classifier, "tables_", None), getattr(classifier, "stumps_", None)
    if isinstance(stumps, Stumps):
        return replace(stumps, columns=np.argsort(order)[stumps.columns].astype(np.int32))
    if isinstance(tables, ColumnTables):
        return tables.columns(order).score_tables(sum(column < n_switches for column in columns))
    if not isinstance(tables, ScoreTables) or order != sorted(order):
        raise CompileError(
            f"{type(classifier).__name__} has no model that is a sum over switches, then joints: use a classifier with "
            "stumps_ or tables_, such as LogitBoostClassifier"
        )
    return tables


def _placed_by(estimator: Any, options: Recipe) -> tuple[Recipe, tuple[float, ...]]:
    """Return the options with the method of the pipeline's SwitchSelector, if it has exactly one, and the gain of each
    switch in the ID3 tree, in the order of the columns.
    """
    steps = [step for _, step in getattr(estimator, "steps", ())]
    steps += [part for step in steps for part in getattr(step, "named_transformers_", {}).values()]
    selectors = [step for step in steps if isinstance(step, SwitchSelector)]
    if len(selectors) != 1:
        return options, ()
    selector, method = selectors[0], METHODS.named(selectors[0].method)
    parameter = {"keep" if method.by_number else "prune": selector.parameter_}
    gains = tuple(selector.gains_[np.argsort(selector.order_)].tolist()) if method.name == PAPERS else ()
    return structs.replace(options, placement=method.name, **parameter), gains


def _trained_by(classifier: Any, options: Recipe) -> Recipe:
    if isinstance(classifier, AdditiveLogitClassifier):
        settings = {"penalty": float(classifier.penalty), "smoothness": float(classifier.smoothness)}
        if classifier.linear:
            return structs.replace(options, trainer="linear", settings=settings)
        bins = classifier.max_bins or HIGHEST_CODE + 1
        return structs.replace(options, trainer="logit", max_bins=bins, settings=settings)
    if not isinstance(classifier, LogitBoostClassifier):
        return structs.replace(options, trainer=type(classifier).__name__)
    return structs.replace(
        options,
        rounds=classifier.rounds,
        shrinkage=float(classifier.shrinkage),
        tolerance=classifier.tolerance,
        max_bins=classifier.max_bins,
    )


def _scores_of(estimator: Any, samples: Samples, options: Recipe, fold: Fold) -> tuple[Scores, list[Hits]]:
    """Fit a clone on the fold's training rows only; return the scores (m, K) of its integers on the test rows, and what
    adapting it to people left out brings.
    """
    learnt, classes = samples.rows(fold.train), estimator.classes_
    fitted = clone(estimator).fit(learnt.inputs, classes[learnt.labels])
    recogniser = Recogniser(options, learnt, *_learnt(fitted, learnt))
    scores = np.full((len(fold.test), len(classes)), _UNSEEN)
    known = (_classifier(fitted).classes_[:, np.newaxis] == classes).argmax(axis=1)
    scores[:, known] = recogniser.scores(tested := samples.rows(fold.test))
    return scores, hits_of(recogniser, tested) if len(known) == len(classes) else []
