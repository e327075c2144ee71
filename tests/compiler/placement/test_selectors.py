"""Selectors, as scikit-learn checks them and as its users join them to other estimators."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.model_selection import GridSearchCV
from sklearn.naive_bayes import BernoulliNB
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import parametrize_with_checks

from thenar.compiler import grow_id3
from thenar.compiler.placement.constraints import Limits
from thenar.compiler.placement.placement import place
from thenar.compiler.placement.ports import PortCosts
from thenar.compiler.placement.selectors import SwitchSelector
from thenar.drivers.errors import SettingError
from thenar.runtime.recipe import Recipe

from ..conftest import make_set, with_none


# Some checks take positive inputs only: all switches are closed then, and scikit-learn warns that none is kept.
@pytest.mark.filterwarnings("ignore:No features were selected")
@parametrize_with_checks(
    [SwitchSelector("id3", binarize=0.0), *(SwitchSelector(name, binarize=0.0) for name in ("cmim", "elimination"))]
)
def test_scikit_learn_s_checks_pass_without_exception(estimator: BaseEstimator, check: Any) -> None:
    check(estimator)


@pytest.fixture(scope="module")
def data() -> tuple[Any, Any]:
    random = np.random.default_rng(2)
    labels = np.arange(120) % 4
    bits = random.random((120, 9)) < 0.3
    bits[:, 5], bits[:, 2] = labels & 1, (labels >> 1) ^ (random.random(120) < 0.05)
    return bits, np.array(["cup", "key", "pen", "rod"])[labels]


@pytest.mark.parametrize("name", ["id3", "elimination", "id3-cost"])
def test_a_selector_keeps_what_thenar_place_keeps(name: str) -> None:
    grasps = make_set(rows=60, switches=10)
    selector = SwitchSelector(name, n_switches=4, min_samples=6).fit(grasps.switches, grasps.grasps)
    papers = name == "id3"
    recipe = Recipe(placement=name, inputs="switches", prune=6 * papers, keep=None if papers else 4)
    placement = place(grasps, recipe)
    assert selector.order_.tolist() == [kept.number for kept in placement.switches]
    assert selector.get_support(indices=True).tolist() == sorted(selector.order_)


def test_rows_in_which_nothing_is_held_place_no_switch() -> None:
    grasps = make_set(subjects=8, types=2)
    more = with_none(grasps)
    found, other = place(grasps, prune=4, keep_joints=1), place(more, prune=4, keep_joints=1)
    assert other.fingerprint == more.fingerprint()
    assert replace(other, fingerprint=found.fingerprint) == found


def test_id3_keeps_its_tree_and_what_each_switch_brought(data: tuple[Any, Any]) -> None:
    X, y = data
    selector = SwitchSelector("id3", min_samples=50).fit(X, y)
    tree = grow_id3(X, y, min_samples=50)
    assert selector.tree_ is not None
    assert selector.tree_.nodes == tree.nodes
    assert selector.classes_.tolist() == list(tree.classes)
    assert selector.gains_.tolist() == list(tree.gains)
    assert set(selector.get_support(indices=True)) == {2, 5}


def test_a_search_over_a_pipeline_finds_how_many_are_enough(data: tuple[Any, Any]) -> None:
    search = GridSearchCV(
        make_pipeline(SwitchSelector("cmim"), BernoulliNB()), {"switchselector__n_switches": [1, 2]}, cv=3
    ).fit(*data)
    assert search.best_params_ == {"switchselector__n_switches": 2}
    assert float(np.mean(search.predict(data[0]) == data[1])) > 0.9


def test_numbers_become_bits_at_a_threshold_or_are_refused(data: tuple[Any, Any]) -> None:
    X, y = data
    pressure = np.where(X, 0.8, 0.1)
    assert SwitchSelector("id3", binarize=0.5).fit(pressure, y).tree_ == SwitchSelector("id3").fit(X, y).tree_
    for selector in (SwitchSelector("id3"), SwitchSelector(n_switches=2)):
        with pytest.raises(ValueError, match=r"X holds 0\.[18] in row 0, column 0"):
            selector.fit(pressure, y)
        with pytest.raises(ValueError, match=r"X holds 7 in row \d+, column \d: neither 0 nor 1"):
            selector.fit(7 * X, y)


def test_what_cannot_be_chosen_is_said(data: tuple[Any, Any]) -> None:
    with pytest.raises(SettingError, match="there is no placement method 'best'"):
        SwitchSelector("best").fit(*data)
    for number in (-1, 0, 2.5, 10, 999):
        with pytest.raises(ValueError, match=rf"n_switches={number}, and X has n_features = 9: give a whole number"):
            SwitchSelector("cmim", number).fit(*data)  # type: ignore[arg-type]
    assert len(SwitchSelector("cmim").fit(*data).order_) == 9
    for number in (-1, 2.5):
        with pytest.raises(ValueError, match=f"min_samples={number}: give a whole number of rows"):
            SwitchSelector("id3", min_samples=number).fit(*data)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="2 switches, the set has 9"):
        SwitchSelector("id3-cost", 3, ports=PortCosts((0, 0), (1.0,))).fit(*data)


@pytest.mark.parametrize("method", ["cmim", "elimination", "id3"])
def test_limits_are_obeyed_by_the_names_of_the_columns(method: str, data: tuple[Any, Any]) -> None:
    bits, labels = data
    names = tuple(f"s{number}" for number in range(9))
    limits = Limits(names=names, n_switches=9, keep=("s8",), never=("s5",))
    kept = np.asarray(SwitchSelector(method, n_switches=3, limits=limits).fit(bits, labels).get_support())
    assert kept[8]
    assert not kept[5]
    with pytest.raises(ValueError, match="the limits name 9 switches, X has 8 columns"):
        SwitchSelector(method, limits=limits).fit(bits[:, :8], labels)
