"""Hands closing on objects: at rest everything is in balance, and each repetition is on its own."""

from dataclasses import replace

import numpy as np
import pytest

from thenar.simulator.body.condition import Condition
from thenar.simulator.body.shapes import Sphere
from thenar.simulator.contact.balance import HOLD_N_PER_MM, USUAL, Skin, SolverCase, SolverSettings
from thenar.simulator.contact.model import GRAVITY
from thenar.simulator.contact.settle import Rest, close

from ..small import make_case

MOST_STEPS = 40
Planned = dict[str, tuple[Condition, ...]]


def heavier(condition: Condition, mass_kg: float) -> Condition:
    return replace(condition, thing=replace(condition.thing, mass_kg=mass_kg))


def pads_n(rest: Rest, condition: Condition) -> np.ndarray:
    """Return what presses on the segments whose pads were told to press (n,)."""
    capsules = condition.hand.sphere_capsules
    told = {int(capsules[pad.sphere]) for pad in condition.held.pads}
    total: np.ndarray = rest.presses[np.isin(capsules, sorted(told))].sum(axis=0)
    return total


def assert_same(one: Rest, other: Rest, place: int, first: int = 0) -> None:
    """Assert that repetition `first` of one is repetition `place` of the other, bit for bit."""
    for field in ("angles", "presses", "residual_n", "residual_nmm", "settled", "steps"):
        assert np.array_equal(getattr(one, field)[..., first], getattr(other, field)[..., place]), field
    assert np.array_equal(one.pose.position[:, first], other.pose.position[:, place])
    assert np.array_equal(one.pose.rotation[..., first], other.pose.rotation[..., place])


@pytest.fixture(scope="module")
def every(planned: Planned, skin: Skin) -> list[tuple[SolverCase, Rest]]:
    """Every grasp type and object of both taxonomies, four repetitions each."""
    cases = [make_case(condition, 4, seed) for scene in planned.values() for seed, condition in enumerate(scene)]
    return list(zip(cases, close(cases, skin, MOST_STEPS), strict=True))


def test_nearly_every_hand_comes_to_rest(every: list[tuple[SolverCase, Rest]]) -> None:
    settled = np.concatenate([rest.settled for _, rest in every])
    assert settled.mean() > 0.97


def test_skin_and_weight_balance_but_for_a_small_share_of_the_load(every: list[tuple[SolverCase, Rest]]) -> None:
    shares = []
    for case, rest in every:
        load = case.grip_n + case.condition.thing.mass_kg * GRAVITY
        shares.append((rest.residual_n / load)[rest.settled])
        # A moment counts over 30 mm, about the half of what is held.
        assert (rest.residual_nmm / 30.0 / load)[rest.settled] == pytest.approx(0.0, abs=0.25), case.condition.grasp
    found = np.concatenate(shares)
    assert np.median(found) < 0.02
    assert found.max() < 0.10


def test_pads_get_most_of_the_grip_in_pinches(by_grasp: dict[str, Condition], skin: Skin) -> None:
    for grasp in ("Tip", "PMF", "CMF", "PE"):
        case = make_case(by_grasp[grasp], 16)
        (rest,) = close([case], skin, MOST_STEPS)
        share = (pads_n(rest, case.condition) / case.grip_n)[rest.settled]
        assert share.mean() > 0.6, grasp
        assert share.max() < 1.4, grasp


def test_friction_carries_the_weight(by_grasp: dict[str, Condition], skin: Skin) -> None:
    # PMF holds a glass upright from its sides: only friction keeps it from falling.
    for grasp in ("PMF", "CMF", "PE"):
        heavy = heavier(by_grasp[grasp], 0.3)
        (sticking,) = close([make_case(heavy, 8, share=0.0)], skin, MOST_STEPS)
        (slipping,) = close([make_case(heavy, 8, share=0.0)], replace(skin, friction=0.0), 100)
        assert sticking.settled.all(), grasp
        assert sticking.residual_n.max() < 0.15 * 0.3 * GRAVITY, grasp
        sinks = [np.einsum("x,xn->n", heavy.held.down, r.pose.position - heavy.held.pose[:3, None]) for r in
                 (sticking, slipping)]  # fmt: skip
        assert sinks[0].max() < sinks[1].min(), grasp


def test_a_hand_that_meets_nothing_and_presses_nothing_stays_as_told(
    by_grasp: dict[str, Condition], skin: Skin
) -> None:
    case = make_case(heavier(by_grasp["CMF"], 0.0), 3, share=0.0)
    clear = replace(case, numbers=case.numbers + np.array([500.0, 0, 0, 0, 0, 0])[:, None], grip_n=np.zeros(3))
    (rest,) = close([clear], skin, MOST_STEPS)
    assert rest.settled.all()
    assert not rest.steps.any()
    assert np.array_equal(rest.angles, clear.angles)
    assert np.array_equal(rest.pose.position, clear.numbers[:3])
    assert not rest.presses.any()
    assert not rest.residual_n.any()


def test_a_hand_that_is_not_given_the_steps_is_marked(every: list[tuple[SolverCase, Rest]], skin: Skin) -> None:
    cases = [case for case, _ in every][:8]
    for most_steps in (1, 2):
        for rest in close(cases, skin, most_steps):
            assert (rest.steps[~rest.settled] == most_steps).all()
            assert not rest.settled.any()


def test_partial_steps_are_counted_and_allowed_as_many_more(every: list[tuple[SolverCase, Rest]], skin: Skin) -> None:
    cases = [case for case, _ in every][:8]
    for rest in close(cases, skin, 2, SolverSettings(parts=3)):
        assert (rest.steps[~rest.settled] == 6).all()
        assert not rest.settled.any()
    whole, parts = (
        np.concatenate([rest.steps for rest in close(cases, skin, MOST_STEPS, pace)])
        for pace in (USUAL, SolverSettings(parts=2))
    )
    assert np.median(parts) > np.median(whole)


def test_a_stricter_rest_is_reached_and_leaves_less(every: list[tuple[SolverCase, Rest]], skin: Skin) -> None:
    cases, strict = [case for case, _ in every], SolverSettings(USUAL.rest_n / 100, USUAL.rest_nmm / 100)
    for case, rest in zip(cases, close(cases, skin, MOST_STEPS, strict), strict=True):
        shift = rest.pose.position - case.numbers[:3]
        held = HOLD_N_PER_MM * np.sqrt((shift * shift).sum(axis=0))
        assert (np.abs(rest.residual_n - held)[rest.settled] < strict.rest_n).all()


def test_an_object_overlapping_the_whole_hand_is_marked(by_grasp: dict[str, Condition], skin: Skin) -> None:
    huge = replace(by_grasp["Tip"], thing=replace(by_grasp["Tip"].thing, shape=Sphere(1500.0), mass_kg=5.0))
    (rest,) = close([make_case(huge, 4)], skin, MOST_STEPS)
    assert not rest.settled.any()
    assert (rest.steps == MOST_STEPS).all()
    assert np.isfinite(rest.angles).all()
    assert np.isfinite(rest.presses).all()
