"""Each switch closes at a force of its own; some are stuck, open or closed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.layout import murakami160
from thenar.simulator.effects import switch_stuck_closed, switch_stuck_open
from thenar.simulator.effects.switch_threshold import LEAST_N, MEMBER, prepare
from thenar.simulator.errors import SceneError

from ..small import make_batch, make_condition, make_draw, make_setting


def thresholds(subject: str, sd_n: float) -> np.ndarray:
    """Return the thresholds (160,) about 1 N."""
    batch = make_batch(range(1), make_condition(subject))
    batch.thresholds_n = np.ones(160)
    prepare(make_setting(), sd_n=sd_n)(batch, make_draw(MEMBER.name, batch))
    return batch.thresholds_n


def test_thresholds_spread_about_the_gloves_as_much_as_is_asked() -> None:
    found = thresholds("A", 0.15)
    # Four standard errors of mean and sd of 160; 0.2 N is 5 sd away.
    assert abs(found.mean() - 1.0) < 4 * 0.15 / 160**0.5
    assert abs(found.std() - 0.15) < 4 * 0.15 / 320**0.5
    assert len(set(found.tolist())) == 160


def test_thresholds_are_the_same_for_everybody() -> None:
    np.testing.assert_array_equal(thresholds("A", 0.15), thresholds("B", 0.15))


@given(sd_n=st.floats(0.0, 5.0))
def test_no_switch_closes_by_itself(sd_n: float) -> None:
    assert thresholds("A", sd_n).min() >= LEAST_N


BOTH = [(switch_stuck_open, False), (switch_stuck_closed, True)]
NAMES = [patch.name for patch in murakami160()]


def read(*effects: tuple, subject: str = "A") -> np.ndarray:
    """Return what is read of random bits (3, 2, 160) after effects, modules with their parameters."""
    batch = make_batch(range(3), make_condition(subject))
    batch.bits = np.random.default_rng(5).random((3, 2, 160)) < 0.5
    for module, parameters in effects:
        module.prepare(make_setting(), **parameters)(batch, make_draw(module.MEMBER.name, batch))
    return batch.bits


@pytest.mark.parametrize(("module", "value"), BOTH)
def test_named_switches_are_stuck_in_every_frame_and_the_others_are_not(module: object, value: bool) -> None:
    free, stuck = read(), read((module, {"switches": (3, NAMES[7], 159)}))
    assert (stuck[:, :, [3, 7, 159]] == value).all()
    others = np.delete(np.arange(160), [3, 7, 159])
    np.testing.assert_array_equal(stuck[:, :, others], free[:, :, others])


@pytest.mark.parametrize(("module", "value"), BOTH)
@given(count=st.integers(1, 160))
def test_fewer_stuck_switches_are_a_subset_of_more(module: object, value: bool, count: int) -> None:
    stuck = (read((module, {"count": count})) == value).all(axis=(0, 1))
    # With 6 random bits beside, about 2 of the other switches look stuck by chance: what is counted is what changed.
    by_chance = (read() == value).all(axis=(0, 1))
    assert count <= np.count_nonzero(stuck) <= count + np.count_nonzero(by_chance)
    fewer = (read((module, {"count": max(count - 1, 1)})) == value).all(axis=(0, 1))
    assert not (fewer & ~stuck).any()


@pytest.mark.parametrize(("module", "value"), BOTH)
def test_one_is_drawn_where_nothing_is_said(module: object, value: bool) -> None:
    changed = (read((module, {})) != read()).any(axis=(0, 1))
    assert np.count_nonzero(changed) == 1


@pytest.mark.parametrize(("module", "value"), BOTH)
def test_everybody_wears_the_same_glove(module: object, value: bool) -> None:
    first, second = (read((module, {"count": 20}), subject=subject) for subject in "AB")
    np.testing.assert_array_equal(first, second)


def test_open_and_closed_ones_are_drawn_apart_and_closed_wins() -> None:
    opened, closed = (
        (read((module, {"count": 40})) != read()).any(axis=(0, 1))
        for module in (switch_stuck_open, switch_stuck_closed)
    )
    assert (opened != closed).any()
    both = read((switch_stuck_open, {"switches": (4, 5)}), (switch_stuck_closed, {"switches": (5, 6)}))
    assert not both[:, :, 4].any()
    assert both[:, :, 5].all()


@pytest.mark.parametrize(("module", "value"), BOTH)
@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"switches": (160,)}, ("switches", "no switch 160", "0 to 159")),
        ({"switches": (-1,)}, ("switches", "no switch -1")),
        ({"switches": ("index_distal_11",)}, ("index_distal_11", "did you mean 'index_distal_1'")),
        ({"count": 161}, ("count", "161", "the glove has 160")),
    ],
)
def test_switches_that_are_not_there_are_refused_with_the_place(
    module: object, value: bool, parameters: dict, words: tuple[str, ...]
) -> None:
    with pytest.raises(SceneError) as caught:
        module.prepare(make_setting(), **parameters)  # type: ignore[attr-defined]
    for word in (f"effects.{module.MEMBER.name}", *words):  # type: ignore[attr-defined]
        assert word in str(caught.value)
