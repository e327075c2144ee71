import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler import grow_id3
from thenar.compiler.placement.costaware import PortCosts, cost_aware_order
from thenar.compiler.placement.id3_family import (
    cost_aware_chooser,
    cost_complexity_chooser,
    every_third,
    id3_chooser,
    reduced_error_chooser,
)
from thenar.compiler.placement.pruning import errors_spared, weakest_links
from thenar.compiler.samples import Samples


@st.composite
def learnings(draw: st.DrawFn) -> Samples:
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, s = draw(st.integers(1, 60)), draw(st.integers(1, 10))
    labels = random.integers(0, 4, n)
    switches = (random.random((4, s)) < 0.5)[labels] ^ (random.random((n, s)) < random.choice([0.0, 0.2]))
    # Class 4 is never met: numbers of the tree's classes are not those of the labels.
    return Samples(switches, np.zeros((n, 0), np.uint16), labels + (labels > 1), tuple("01234"))


@given(learnings(), st.integers(0, 61))
def test_one_tree_answers_for_every_s_as_the_papers_pruned_tree_does(learning: Samples, s: int) -> None:
    assert id3_chooser(learning)(s) == grow_id3(learning.switches, learning.labels, min_samples=s).inputs


@given(learnings(), st.integers(0, 11))
def test_no_more_switches_are_kept_than_asked_for(learning: Samples, most: int) -> None:
    ports = PortCosts((0,) * learning.n_switches, (10.0,))
    for chooser in (cost_complexity_chooser(learning), reduced_error_chooser(learning)):
        assert len(set(chooser(most))) == len(chooser(most)) <= most
    assert (
        cost_aware_chooser(learning, ports)(most) == cost_aware_order(learning.switches, learning.labels, ports)[:most]
    )


@given(learnings())
def test_links_that_bring_nothing_cost_no_input_unless_asked_to(learning: Samples) -> None:
    assert cost_complexity_chooser(learning)(10) == grow_id3(learning.switches, learning.labels).inputs


@given(learnings())
def test_reduced_error_pruning_grows_on_two_thirds_and_prunes_on_the_rest(learning: Samples) -> None:
    out = every_third(learning.labels)
    tree = grow_id3(learning.switches[~out], learning.labels[~out])
    numbers = np.array([tree.classes.index(label) for label in learning.labels[out].tolist()], dtype=np.intp)
    path = weakest_links(tree, errors_spared(tree, learning.switches[out], numbers))
    assert reduced_error_chooser(learning)(10) == path.placement(10, path.n_useless)


def test_every_third_row_of_each_class_is_held_out() -> None:
    labels = np.array([1, 0, 1, 1, 0, 0, 0, 2, 1, 1, 1])
    assert np.flatnonzero(every_third(labels)).tolist() == [3, 5, 10]
