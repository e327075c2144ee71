"""The hard case of contact: what its bounds are worth, and the same truths over inputs that hypothesis makes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mpmath import mpf

from thenar.simulator.body.hand import CAPSULES
from thenar.simulator.body.layout import Switches, murakami160
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere, rotation
from thenar.simulator.contact.balance import Case
from thenar.simulator.contact.model import split
from thenar.simulator.contact.settle import Rest, close
from thenar.simulator.effects.contact_quasistatic import Parameters, Quasistatic
from thenar.stability.contact.grasps import HAND, Grasp, case_of, hard, held, planned
from thenar.stability.contact.halving import kept, shipped
from thenar.stability.contact.posed import centres, digits, exactly, left_of, length, surface
from thenar.stability.contact.rest import SKIN, is_honest
from thenar.stability.contact.surfaces import MOST_SWITCHES
from thenar.stability.contact.systems import errors, near_singular
from thenar.stability.finding import Worst
from thenar.stability.reference.numbers import exact, precisely

GRASPS = list(hard(full=False))
LENGTHS = st.sampled_from((5e-324, 1e-300, 1e-150)) | st.floats(1e-12, 2000.0)
PLACES = st.sampled_from((0.0, -0.0, 5e-324, -1e-200, 1e-155, 1e-13)) | st.floats(-3000.0, 3000.0)


@st.composite
def shapes(draw: st.DrawFn) -> Shape:
    sizes, share = [draw(LENGTHS) for _ in range(3)], draw(st.sampled_from((0.0, 1.0)) | st.floats(0.0, 1.0))
    made = (
        Sphere(sizes[0]),
        Cylinder(sizes[0], sizes[1], share * (min(sizes[:2]) / 2)),
        Box(sizes[0], sizes[1], sizes[2], share * (min(sizes) / 2)),
    )
    return made[draw(st.integers(0, 2))]


@given(shapes(), arrays(np.float64, 3, elements=PLACES))
def test_any_place_off_any_thing_has_its_distance_and_one_way_out(shape: Shape, place: np.ndarray) -> None:
    distance, normal = (values[0, ..., 0] for values in shape.distance(place[None, :, None]))
    with precisely():
        size = sum(map(exact, shape.extent_mm())) + sum(abs(exact(x)) for x in place.tolist())
        off = abs(exact(distance.item()) - surface(shape, place.tolist())[0])
        assert off <= 9 * mpf(2) ** -53 * size + mpf(10) ** -150
        assert abs(length(exactly(normal)) - 1) <= 8 * mpf(2) ** -53


@given(st.integers(0, 2**32), st.integers(1, 4), st.integers(-11, 2))
@settings(max_examples=25, deadline=None)
def test_systems_next_to_singular_are_solved_within_the_bound_of_their_roundings(
    seed: int, rank: int, power: int
) -> None:
    residual, error = errors(near_singular(np.random.default_rng(seed), rank, 10.0**power))
    assert residual <= 79.0
    assert error <= 1.0


def test_a_system_that_is_not_positive_has_no_error_that_holds() -> None:
    system = near_singular(np.random.default_rng(1), 4, 1.0)
    with np.errstate(invalid="ignore"):
        found = errors(system._replace(body=-system.body))
    worst = Worst("", "", 79.0, "")
    worst.see(found[0])
    assert not worst.finding().holds


@given(st.data())
def test_forces_of_all_sizes_over_depths_of_all_sizes_are_shared_without_loss(data: st.DataObject) -> None:
    switches = Switches(HAND, murakami160())
    sizes = st.floats(0.0, 1e300, allow_subnormal=True)
    depths = data.draw(arrays(np.float64, (len(switches.capsules), 1), elements=sizes | st.just(-1.0), fill=sizes))
    forces = data.draw(arrays(np.float64, (len(CAPSULES), 1), elements=sizes, fill=sizes))
    shared, between = split(switches, depths / 16, forces)
    for capsule, force in enumerate(forces[:, 0]):
        own = switches.capsules == capsule
        if (depths[own] / 16 > 0.0).any():
            with precisely():
                borne = sum(map(exact, shared[own, 0]))
                assert (
                    abs(borne - exact(force))
                    <= (MOST_SWITCHES + 1) * mpf(2) ** -53 * exact(force) + MOST_SWITCHES * mpf(2) ** -1074
                )
    assert np.isfinite(between).all()


@given(st.tuples(*[st.floats(-3.1, 3.1)] * 3), st.sampled_from((1.0, 1e-4, 1e-8, 1e-160, 0.0)))
def test_turned_axes_stay_square_and_of_unit_length(vector: tuple[float, ...], scale: float) -> None:
    turned = rotation(scale * np.array(vector)[:, None])[..., 0]
    # An element is off by 40 roundings up to half a turn, by no more than twice that up to 5.4 rad; a product of rows
    # of three by 2 * 3 * 80 at most.
    assert np.abs(turned @ turned.T - np.eye(3)).max() <= 480 * 2.0**-53


def settled(grasp: Grasp) -> tuple[Case, Rest]:
    case = case_of(grasp.load)
    (rest,) = close([case], SKIN, Parameters().most_steps)
    assert rest.settled[0]
    return case, rest


def test_the_truth_lies_where_the_hand_says() -> None:
    grasp = held()
    angles = np.radians(grasp.load.posture_deg.T)
    found = np.array([[float(x) for x in centre] for centre in centres(HAND, digits(HAND, angles[:, 0].tolist()))])
    assert found == pytest.approx(HAND.spheres(HAND.skeleton(angles))[..., 0], abs=1e-12)


@pytest.mark.parametrize("field", ["angles", "position", "drags"])
def test_rest_that_is_a_little_off_is_found_out_at_60_digits(field: str) -> None:
    case, rest = settled(held())
    before = left_of(case, rest, SKIN, 0)
    assert before.force_n < 0.05
    assert max(before.moment_nmm, before.joints_nmm) < 3.0
    assert before.press_n < 1e-11
    assert not before.outside
    if field == "angles":
        rest.angles[9] += 0.005
    elif field == "position":
        rest.pose.position[1] += 0.2
    else:
        rest.drags[:] *= 2.5
    after = left_of(case, rest, SKIN, 0)
    assert max(after.force_n / 0.05, after.moment_nmm / 3.0, after.joints_nmm / 3.0) > 1.0
    assert after.outside > 0 if field == "drags" else after.press_n > 1e-3


def test_every_hard_grasp_comes_to_the_same_numbers_alone_as_in_company() -> None:
    model = Quasistatic(Parameters())
    some = GRASPS[::5]
    for grasp, together in zip(some, model.solve([each.load for each in some]), strict=True):
        (alone,) = model.solve([grasp.load])
        assert np.array_equal(alone.forces_n, together.forces_n), grasp.name
        assert is_honest(alone), grasp.name


def test_an_answer_that_is_no_number_is_not_honest() -> None:
    (contact,) = Quasistatic(Parameters()).solve([held().load])
    assert is_honest(contact)
    assert not is_honest(replace(contact, forces_n=contact.forces_n * np.nan))
    endless = replace(contact, residual_n=contact.residual_n * np.inf)
    assert not is_honest(endless)
    assert is_honest(replace(endless, settled=~endless.settled))


def test_hands_of_1_and_99_percent_are_those_of_the_survey() -> None:
    lengths = {grasp.name.split(",")[0]: grasp.load.condition.hand.size.length_mm for grasp in planned(9)}
    assert lengths == {"a hand of 1 %": pytest.approx(157.6, abs=0.1), "a hand of 99 %": pytest.approx(216.3, abs=0.1)}


def test_most_shipped_grasps_settle_so_that_halved_steps_are_compared_at_all() -> None:
    loads = list(shipped(1))
    assert kept(loads, Quasistatic(Parameters()).solve(loads)).mean() > 0.9
