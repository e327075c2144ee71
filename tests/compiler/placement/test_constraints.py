"""Limits: every method obeys them, contradictions are refused, and the bound on the best subset holds under them."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from thenar.compiler.placement.constraints import Bound, Limits
from thenar.compiler.placement.elements import Element, Elements
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.placement.placement import choose, kept_joints
from thenar.compiler.placement.ports import PortCosts, record_times_us
from thenar.compiler.samples import Columns, Samples, TrainingError
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.harness.wiring import GloveWiring

# Three switches, then two taxels of three and two levels.
NAMES = ("a", "b", "c", "p", "q")
ELEMENTS: Elements = (*map(Element, range(3)), *(Element(3, code) for code in (1, 2, 3)), Element(4, 1), Element(4, 2))
PORTS = PortCosts((0, 0, 1, 2, 2, 2, 3, 3), (10.0, 5.5, 7.0, 7.0))
PLACES = {"a": (0.0, 0.0), "b": (6.0, 0.0), "c": (0.0, 9.0), "p": (5.0, 5.0), "q": (30.0, 0.0)}


def samples_of(seed: int, n: int = 40) -> Samples:
    random = np.random.default_rng(seed)
    raw = np.hstack([random.integers(0, 2, (n, 3)), random.integers(0, 5, (n, 2))])
    bits = np.stack([raw[:, element.column] > element.code for element in ELEMENTS], axis=1)
    labels = (raw.sum(axis=1) + random.integers(0, 2, n)) % 3
    return Samples(bits, np.zeros((n, 0), np.uint16), labels, ("x", "y", "z"))


def obeys(limits: Limits, kept: tuple[int, ...]) -> bool:
    """Return whether these elements obey, by the words of the limits."""
    names = [NAMES[ELEMENTS[one].column] for one in kept]
    taxels = {name for name in names if name in ("p", "q")}
    apart = all(
        one == other or np.hypot(*np.subtract(PLACES[one], PLACES[other])) >= limits.apart_mm
        for one, other in combinations(names, 2)
    )
    us = sum(PORTS.us[port] for port in {PORTS.port_of[one] for one in kept})
    return (
        set(limits.keep) <= set(names)
        and set(limits.never).isdisjoint(names)
        and apart
        and (limits.taxels is None or len(taxels) <= limits.taxels)
        and (limits.budget_us is None or us <= limits.budget_us)
    )


@st.composite
def bound_limits(draw: st.DrawFn) -> tuple[Limits, Bound]:
    some = st.lists(st.sampled_from(NAMES), max_size=2, unique=True).map(tuple)
    try:
        limits = Limits(
            names=NAMES,
            n_switches=3,
            keep=draw(some),
            never=draw(some),
            apart_mm=draw(st.sampled_from([0.0, 6.0, 6.5, 9.5])),
            taxels=draw(st.sampled_from([None, 0, 1])),
            budget_us=draw(st.sampled_from([None, 6.0, 15.5, 22.5])),
            places=PLACES,
        )
        return limits, limits.on(ELEMENTS, PORTS)
    except TrainingError:
        assume(False)
        raise


@settings(deadline=None, max_examples=15, suppress_health_check=[HealthCheck.filter_too_much])
@given(found=bound_limits(), seed=st.integers(0, 2**32 - 1), m=st.integers(2, 5))
def test_every_method_obeys(found: tuple[Limits, Bound], seed: int, m: int) -> None:
    limits, bound = found
    samples = samples_of(seed)
    for name in (
        "id3",
        "id3-cost",
        "elimination-cost",
        "cmim",
        "mutual-information",
        "random",
    ):
        by_number = METHODS[name].by_number
        columns, gains, _ = choose(samples, name, m if by_number else 4, PORTS, bound)
        assert obeys(limits, columns), name
        assert len(columns) == len(set(columns)) == len(gains)
        assert not by_number or len(columns) <= m


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_limits_are_obeyed_and_idle_ones_change_nothing(name: str) -> None:
    samples, parameter = samples_of(5, 120), 3 if METHODS[name].by_number else 10
    free = Limits(names=NAMES, n_switches=3, taxels=9).on(ELEMENTS, PORTS)
    plain = choose(samples, name, parameter, PORTS)
    assert choose(samples, name, parameter, PORTS, free) == plain
    first = (*plain[0], 0)[0]
    limits = Limits(names=NAMES, n_switches=3, never=(NAMES[ELEMENTS[first].column],), taxels=1)
    assert obeys(limits, choose(samples, name, parameter, PORTS, limits.on(ELEMENTS, PORTS))[0])


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"keep": ("a",), "never": ("b", "a")}, "``have`` and ``never`` both name a"),
        ({"keep": ("a", "b"), "apart_mm": 6.5}, "``have`` a,b are 6.0 mm apart, ``apart_mm`` requires 6.5"),
        ({"keep": ("p", "q"), "taxels": 1}, "``have`` names more taxels than ``at_most`` 1 taxels"),
        ({"keep": ("a", "c"), "budget_us": 12.0}, "``have`` takes 15.5 µs to read, ``budget_us`` allows 12"),
        ({"budget_us": 5.0}, "``never`` and ``budget_us`` leave nothing"),
        ({"never": ("pp",)}, "no input 'pp'"),
        ({"apart_mm": 1.0, "places": {"a": (0.0, 0.0)}}, "``apart_mm``: the position of b, c, p, q is unknown"),
    ],
)
def test_contradictions_are_refused_by_both_names(asked: dict[str, object], message: str) -> None:
    with pytest.raises(TrainingError, match=message):
        Limits(names=NAMES, n_switches=3, **{"places": PLACES, **asked}).on(ELEMENTS, PORTS)  # type: ignore[arg-type]


def test_too_many_forced_switches_and_budgets_without_costs_are_refused() -> None:
    limits = Limits(names=NAMES, n_switches=3, keep=("a", "b", "q"), budget_us=99.0)
    with pytest.raises(TrainingError, match="``have`` names 3, ``keep`` allows 2"):
        choose(samples_of(1), "cmim", 2, PORTS, limits.on(ELEMENTS, PORTS))
    with pytest.raises(TrainingError, match="``budget_us`` needs the cost of reading"):
        limits.on(ELEMENTS, None)


def test_joints_are_kept_and_left_out_by_name_as_switches_are() -> None:
    random = np.random.default_rng(7)
    labels = np.arange(60) % 3
    codes = np.stack([labels * 40, labels * 30, random.integers(0, 99, 60), random.integers(0, 99, 60)], axis=1)
    samples = Samples(np.zeros((60, 0), bool), codes.astype(np.uint16), labels, ("x", "y", "z"))
    own = {"names": NAMES, "n_switches": 3, "joints": ("j0", "j1", "j2", "j3")}
    limits = Limits(**own, keep=("j3",), never=("j0",))  # type: ignore[arg-type]
    assert kept_joints(samples, 2, limits) == (1, 3)
    assert kept_joints(samples, None, limits) == (1, 2, 3)
    assert kept_joints(samples, 1, limits) == (3,)
    with pytest.raises(TrainingError, match="``have`` names 2 joints, ``keep_joints`` allows 1"):
        kept_joints(samples, 1, Limits(**own, keep=("j3", "j1")))  # type: ignore[arg-type]
    with pytest.raises(TrainingError, match="``have`` names a, and ``inputs`` leaves that out"):
        Limits(**own, keep=("a",)).on((), None)  # type: ignore[arg-type]
    limits.on((), None)


@pytest.mark.parametrize("mask", [True, False])
@pytest.mark.parametrize("budget_us", [300.0, 900.0, 1290.0, 1500.0, 7000.0])
def test_no_more_joints_are_kept_than_a_record_within_the_budget_has(budget_us: float, mask: bool) -> None:
    """A record is 3 bytes and one a sensor, at 86.8 µs, and 250 µs to digitise each: of all sets, the largest fit."""
    joints = SENSORS_18[:4]
    glove = GloveWiring(port="p", mask=mask)
    times = record_times_us(joints, glove)

    def fits(kept: Columns) -> bool:
        sensors = len(kept) if mask else 18
        return not kept or (sensors + 3) * 10 / 0.1152 + sensors * 250 <= budget_us

    random = np.random.default_rng(7)
    labels = np.arange(60) % 3
    codes = (labels[:, None] * 40 + random.integers(0, 60, (60, 4))).astype(np.uint16)
    samples = Samples(np.zeros((60, 0), bool), codes, labels, ("x", "y", "z"))
    limits = Limits(names=(), n_switches=0, joints=joints, budget_us=budget_us, records_us=times)
    limits.on((), None)
    kept = kept_joints(samples, None, limits)
    allowed = [subset for size in range(5) for subset in combinations(range(4), size) if fits(subset)]
    assert kept in allowed
    assert len(kept) == max(map(len, allowed))
    assert len(kept_joints(samples, 2, limits)) == min(2, len(kept))
    if len(kept) < 3:
        with pytest.raises(TrainingError, match=r"``have`` names 3 joints, whose record takes \d+\.\d µs"):
            kept_joints(samples, None, replace(limits, keep=joints[:3]))


def test_records_are_known_of_a_cyberglove_however_its_joints_are_called() -> None:
    named = tuple(f"g{sensor}" for sensor in range(18))
    assert record_times_us(named[:2]) == record_times_us(()) == ()
    assert record_times_us(named[:2], GloveWiring(port="p", joints=named)) == record_times_us(SENSORS_18[:2])
