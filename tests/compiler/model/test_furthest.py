import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.proof import furthest
from thenar.runtime.model.terms.base import HIGHEST_CODE
from thenar.runtime.scores import LANE_OFFSET, Scorer
from thenar.stability.inputs.hard_tables import every_frame


def whole_numbers(seed: int, classes: int, switches: int, bins: tuple[int, ...], most: int) -> IntegerTables:
    """Return integer tables of random numbers up to `most`, in which a mean may lie outside its rows."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> NDArray[np.int16]:
        return random.integers(-most, most + 1, shape).astype(np.int16)

    thresholds = [np.sort(random.choice(HIGHEST_CODE, n - 1, replace=False)).astype(np.uint16) for n in bins]
    joints = tuple(rows(n, classes) for n in bins)
    means = rows(switches, classes), rows(len(bins), classes)
    return IntegerTables.of(rows(classes), rows(switches, classes), tuple(thresholds), joints, *means, 1.0)


tables = st.builds(
    whole_numbers,
    st.integers(0, 10_000),
    st.integers(2, 5),
    st.integers(0, 5),
    st.lists(st.integers(1, 4), max_size=2).map(tuple),
    st.sampled_from([1, 10, 1000]),
)


@given(tables)
def test_the_first_terms_reach_the_bound_and_no_running_sum_leaves_it(tables: IntegerTables) -> None:
    found = furthest(tables)
    running = np.cumsum(found.terms[found.order, found.grasp].astype(int))
    assert abs(found.total) == tables.bound
    assert (running[found.n_terms - 1] if found.n_terms else 0) == found.total
    assert np.abs(running).max() <= tables.bound


@given(tables)
def test_its_frame_scores_as_its_terms_add_up(tables: IntegerTables) -> None:
    found = furthest(tables)
    lanes = Scorer(tables).biased_scores_without(found.bits, found.codes, found.lost_switches, found.lost_joints)
    assert (np.array(lanes) - LANE_OFFSET).tolist() == found.terms.sum(axis=0, dtype=int).tolist()
    assert sorted(found.order) == list(range(len(found.terms)))


@settings(deadline=None, max_examples=40)
@given(tables)
def test_without_gaps_it_is_the_furthest_of_all_whole_frames(tables: IntegerTables) -> None:
    found = furthest(tables, missing=False)
    assert not found.lost_switches.any()
    assert not found.lost_joints.any()
    furthest_of_all = 0
    for bits, codes in every_frame(tables):
        rows = [tables.bias, *tables.switch_rows[list(bits)]]
        joints = zip(tables.thresholds, tables.joint_rows, codes, strict=True)
        terms = np.array([*rows, *(of[int((steps < code).sum())] for steps, of, code in joints)], int)
        furthest_of_all = max(furthest_of_all, *np.maximum(terms, 0).sum(axis=0), *np.maximum(-terms, 0).sum(axis=0))
    assert abs(found.total) == furthest_of_all


def test_a_bin_that_no_code_falls_into_is_in_no_frame() -> None:
    silent = whole_numbers(0, 2, 0, (2,), 0)
    rows = np.array([[3, 0], [9, 0]], np.int16)
    found = furthest(silent.changed(thresholds=(np.array([65535], np.uint16),), joint_rows=(rows,)))
    assert (found.total, found.codes.tolist()) == (3, [0])


def test_a_bin_is_shown_by_its_lowest_existing_code() -> None:
    silent = whole_numbers(0, 2, 0, (3,), 0)
    for bin_, code in enumerate((0, 10, 65535)):
        rows = np.zeros((3, 2), np.int16)
        rows[bin_] = 5, 0
        found = furthest(silent.changed(thresholds=(np.array([9, 65534], np.uint16),), joint_rows=(rows,)))
        assert (found.total, found.codes.tolist()) == (5, [code])
