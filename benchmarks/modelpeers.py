"""The models in the comparison: thenar's trainers, in floating point and as deployed integers, and others.

If several settings are listed, they are chosen by inner folds of the training rows, grouped like the outer ones. Models
marked `slow` use the first on sets of more than `FEW` rows.
"""

import importlib.util
import re
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from modelsets import Cut
from numpy.typing import NDArray
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import ExtraTreesClassifier, HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC
from weka import installed, logitboost, write_arff

from thenar.compiler.evaluation.choosing import choose_training
from thenar.compiler.model.collapse import collapse
from thenar.compiler.samples import Samples, decided
from thenar.compiler.trainers.base import Training
from thenar.runtime.model.quantise import quantise
from thenar.runtime.recipe import AUTO, Recipe

FEW, SEED = 2000, 1

Classes = NDArray[np.intp]
Given = Mapping[str, Any]
# A model's predictions for the rows of a fold with given settings, also those of its integers.
Predicting = Callable[[Cut, Given], tuple[Classes, Classes | None]]


@dataclass(frozen=True, slots=True)
class Model:
    """A model: its candidate settings, the first of which is a good default, and its predictions, also as integers.

    needs     a package, or "java", without which it is left out
    additive  whether its scores are a sum over inputs
    """

    name: str
    how: str
    predict: Predicting
    settings: tuple[Given, ...] = ({},)
    additive: bool = False
    slow: bool = False
    ours: bool = False
    needs: str = "sklearn"

    @property
    def there(self) -> bool:
        """Whether its requirements are installed."""
        if self.needs == "java":
            return installed()
        return importlib.util.find_spec(self.needs) is not None

    def predicted(self, cut: Cut) -> tuple[Classes, Classes | None]:
        """Return the class of each test row, and that by the integers, with settings chosen inside."""
        given = self.settings[0]
        if len(self.settings) > 1 and not (self.slow and len(cut.train.labels) > FEW):
            given = max(self.settings, key=lambda each: self._inside(cut, each))  # the first of equal ones
        return self.predict(cut, given)

    def _inside(self, cut: Cut, given: Given) -> int:
        right = 0
        for fold in cut.inner():
            part = replace(cut, train=cut.train.rows(fold.train), test=cut.train.rows(fold.test))
            right += int(recognised(self.predict(part, given)[0], part.test).sum())
        return right


def recognised(predict: Classes, test: Samples) -> NDArray[np.bool_]:
    """Return whether each trial is correct by the majority of its frames."""
    _, first, trial = np.unique(test.trials, return_index=True, return_inverse=True)
    given: NDArray[np.bool_] = decided(predict[np.newaxis], trial)[0] == test.labels[first]
    return given


def _trained(name: str) -> Predicting:
    def predict(cut: Cut, _: Given) -> tuple[Classes, Classes]:
        train, test, options = cut.train, cut.test, Recipe(trainer=name)
        training = Training.of(options)
        if name == AUTO:
            groups = train.subjects if cut.of == "new subject" else None
            training = Training.chosen(choose_training(train, Training.candidates(options), groups=groups, of=cut.of))
        model = training.train(train)
        integers = quantise(collapse(model, train.n_switches), train.switches, train.codes)
        floats = model.scores(test.switches, test.codes)
        return floats.argmax(axis=1), integers.scores(test.switches, test.codes).argmax(axis=1)

    return predict


def _fitted(make: Callable[..., Any], *, scaled: bool = False, **fixed: Any) -> Predicting:
    def predict(cut: Cut, given: Given) -> tuple[Classes, None]:
        train = cut.train
        X, asked = (np.hstack([part.switches, part.codes]).astype(np.float64) for part in (train, cut.test))
        if scaled:
            joints = slice(train.n_switches, None)
            mean, spread = X[:, joints].mean(axis=0), X[:, joints].std(axis=0)
            for part in (X, asked):
                part[:, joints] = (part[:, joints] - mean) / np.where(spread > 0, spread, 1.0)
        # Boosters want classes 0, 1, ...: a training part may lack one.
        classes, labels = np.unique(train.labels, return_inverse=True)
        return classes[np.asarray(make(**fixed, **given).fit(X, labels).predict(asked)).astype(np.intp).ravel()], None

    return predict


def _ebm(**given: Any) -> Any:
    from interpret.glassbox import ExplainableBoostingClassifier  # pyright: ignore[reportMissingImports]

    return ExplainableBoostingClassifier(outer_bags=4, n_jobs=1, **given)


def _weka(cut: Cut, _: Given) -> tuple[Classes, None]:
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("train.arff", "test.arff")]
        for path, part in zip(paths, (cut.train, cut.test), strict=True):
            # Nominal switches are far worse on few rows.
            write_arff(path, part.switches, part.codes, part.labels, part.n_classes)
        command = logitboost(100, "-t", str(paths[0]), "-T", str(paths[1]), "-p", "0")
        printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = re.findall(r"^ *\d+ +\d+:g\d+ +\d+:g(\d+) ", printed, re.MULTILINE)
    return np.array(found, np.intp), None


def _grid(**values: Sequence[Any]) -> tuple[Given, ...]:
    return tuple(dict(zip(values, each, strict=True)) for each in product(*values.values()))


OURS = tuple(
    Model(name, how, _trained(name), additive=True, ours=True, needs="thenar")
    for name, how in (
        ("logitboost", "100 rounds, the paper's"),
        ("linear", "default settings"),
        ("discriminant", "joints as lines"),
        ("logit", "default settings"),
        ("pairs", "default settings"),
        (AUTO, "chosen by inner folds"),
    )
)
PEERS = (
    Model(
        "logistic regression",
        "C of 4",
        _fitted(LogisticRegression, scaled=True, max_iter=2000),
        _grid(C=[1, 0.1, 10, 100]),
        additive=True,
    ),
    Model(
        "discriminant analysis",
        "shrunk as in Ledoit-Wolf",
        _fitted(LinearDiscriminantAnalysis, solver="lsqr", shrinkage="auto"),
        additive=True,
    ),
    Model(
        "k neighbours",
        "k of 4, by distance",
        _fitted(KNeighborsClassifier, scaled=True, weights="distance"),
        _grid(n_neighbors=[5, 1, 3, 10]),
    ),
    Model(
        "RBF SVM",
        "C of 3, gamma of 4",
        _fitted(SVC, scaled=True),
        _grid(C=[10, 1, 100], gamma=[0.03, 0.01, 0.1, 0.3]),
    ),
    Model("random forest", "500 trees", _fitted(RandomForestClassifier, n_estimators=500, random_state=SEED)),
    Model("extra trees", "500 trees", _fitted(ExtraTreesClassifier, n_estimators=500, random_state=SEED)),
    Model(
        "histogram boosting",
        "150 rounds, leaves of 2",
        _fitted(HistGradientBoostingClassifier, max_iter=150, min_samples_leaf=5, random_state=SEED),
        _grid(max_leaf_nodes=[7, 31]),
        slow=True,
    ),
    Model(
        "EBM",
        "4 bags, no pairs",
        _fitted(_ebm, random_state=SEED, interactions=0),
        additive=True,
        needs="interpret",
    ),
    Model("EBM with pairs", "4 bags, 5 pairs", _fitted(_ebm, random_state=SEED, interactions=5), needs="interpret"),
    Model("Weka LogitBoost", "100 rounds", _weka, additive=True, needs="java"),
)
