"""A placement is bettered for many subjects by exchanges at its edge, and by nothing else."""

import numpy as np
import pytest

from thenar.compiler.placement import refining as module
from thenar.compiler.placement.refining import EXCHANGES, Refining
from thenar.compiler.placement.serving import Aim, Crowd
from thenar.compiler.samples import Columns, Samples

TYPES, EACH, PEOPLE = 4, 40, 20
FEW = (3, 11)


@pytest.fixture(autouse=True)
def _twenty_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ENOUGH_SUBJECTS", 8)


def crowd(people: int = PEOPLE) -> Crowd:
    """Return people whom switches 0 and 1 serve; a FEW of them press 0 at random, and 2 tells what 0 does of all, less
    well; 3 and above tell nothing.
    """
    random = np.random.default_rng(8)
    subjects = np.repeat(np.arange(people), EACH)
    labels = np.arange(people * EACH) % TYPES
    bits = random.random((len(labels), 7)) < 0.5
    low, high = (labels & 1).astype(bool), (labels >> 1).astype(bool)
    few = np.isin(subjects, FEW)
    bits[:, 0] = np.where(few, bits[:, 0], low)
    bits[:, 1] = high
    bits[:, 2] = low ^ (random.random(len(labels)) < 0.12)
    return Crowd(Samples(bits, np.zeros((len(labels), 0), np.uint16), labels, tuple(map(str, range(TYPES)))), subjects)


def refining(kept: Columns, spare: Columns, people: int = PEOPLE) -> Refining:
    return Refining(crowd(people), kept, spare, rows=400, rounds=10, seed=1)


@pytest.mark.parametrize(("aim", "wanted"), [("plain", {1, 4}), ("mean", {0, 1}), ("worst tenth", {1, 2})])
def test_each_aim_finds_the_exchange_that_serves_it(aim: Aim, wanted: set[int]) -> None:
    """Without 0 nobody is served well; 0 serves the many to perfection, 2 everybody almost so."""
    assert set(refining((1, 4), (0, 2, 5)).best(aim)) == wanted


def test_what_is_exchanged_takes_the_place_of_what_goes() -> None:
    assert refining((4, 1), (0, 5)).best("mean") == (0, 1)


def test_a_placement_that_nothing_betters_stays_as_it_is() -> None:
    assert refining((1, 0), (3, 4, 5)).best("mean") == (1, 0)
    assert refining((1, 0), ()).best("worst tenth") == (1, 0)


def test_only_the_edge_changes_and_only_so_often() -> None:
    assert refining((3, 4, 5, 6), (0, 1, 2)).best("mean")[:EXCHANGES] != (3, 4)
    kept = (3, 4, 5, 6)
    assert len(set(refining(kept, (0, 1, 2)).best("mean")) - set(kept)) == EXCHANGES
    assert refining((3, 0, 4, 1, 5), (2,)).best("worst tenth")[0] == 3


def test_few_subjects_are_left_to_the_method() -> None:
    assert refining((1, 4), (0, 2), people=7).best("mean") == (1, 4)
    assert refining((1, 4), (0, 2), people=8).best("mean") == (1, 0)
