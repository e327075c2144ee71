"""Every fault against the runtime's own scorer, frame by frame."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.model import faults
from thenar.compiler.model.faults import count_faults, groups_of, worst_faults
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.terms.grid import Grid
from thenar.runtime.model.terms.line import Line
from thenar.runtime.scanning.scanmap import Port, ScanMap, StreamRead
from thenar.runtime.scores import Scorer


def tables_of(
    random: np.random.Generator, classes: int, switches: int, joints: int, *, slope: bool, pair: bool = False
) -> IntegerTables:
    def rows(*shape: int) -> np.ndarray:
        # Few different steps, so that scores tie.
        return random.integers(-3, 4, shape).astype(np.int16)

    def steps() -> np.ndarray:
        return np.unique(random.integers(0, 30, random.integers(0, 4))).astype(np.uint16)

    thresholds = tuple(steps() for _ in range(joints))
    both = steps(), steps()
    joined = Grid((0, joints - 1), both, rows(len(both[0]) + 1, len(both[1]) + 1, classes))
    line = Line(0, 5, 15, rows(classes).astype(np.int8), 0)
    return IntegerTables.of(
        bias=rows(classes),
        switch_rows=rows(switches, classes),
        thresholds=thresholds,
        joint_rows=tuple(rows(len(steps) + 1, classes) for steps in thresholds),
        switch_means=rows(switches, classes),
        joint_means=rows(joints, classes),
        scale=1.0,
        further=(line,) if slope and joints else (joined,) if pair and joints > 1 else (),
    )


def recognised(lanes: list[tuple[int, ...]], labels: np.ndarray, trials: np.ndarray) -> int:
    """Return the trials, the majority of whose frames is right, the lowest class of several."""
    answers: dict[int, Counter[int]] = {}
    truth = dict(zip(trials.tolist(), labels.tolist(), strict=True))
    for scores, trial in zip(lanes, trials.tolist(), strict=True):
        answers.setdefault(trial, Counter())[scores.index(max(scores))] += 1
    return sum(min(found, key=lambda k: (-found[k], k)) == truth[trial] for trial, found in answers.items())


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    classes=st.integers(2, 5),
    switches=st.integers(0, 4),
    joints=st.integers(0, 3),
    slope=st.booleans(),
    pair=st.booleans(),
    own_trials=st.booleans(),
    held=st.sampled_from([1, 200, 1 << 23]),
)
def test_every_fault_is_counted_as_the_runtime_scores_it(
    seed: int, classes: int, switches: int, joints: int, slope: bool, pair: bool, own_trials: bool, held: int
) -> None:
    random, n = np.random.default_rng(seed), 24
    tables = tables_of(random, classes, switches, joints, slope=slope, pair=pair)
    bits, codes = random.random((n, switches)) < 0.5, random.integers(0, 32, (n, joints)).astype(np.uint16)
    trials = np.arange(n) if own_trials else random.integers(0, 6, n)
    # A label beyond the classes is a type that the build does not know.
    labels = random.integers(0, classes + 1, n)[trials % n]
    scorer, inputs = Scorer(tables), switches + joints
    ends = tuple({switches, inputs - 1}) if joints else ()  # of a pair, where there is one
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(faults, "_HELD", held)
        found = count_faults(tables, bits, codes, labels, trials, [range(inputs), (), ends])

    def without(*lost: int) -> int:
        mask = np.isin(np.arange(inputs), lost)
        masks = mask[:switches], mask[switches:]
        lanes = [scorer.biased_scores(own, joint, *masks) for own, joint in zip(bits, codes, strict=True)]
        return recognised(lanes, labels, trials)

    assert found.total == len(set(trials.tolist()))
    assert found.correct == without() == found.dead[1]
    assert found.lost == tuple(without(one) for one in range(inputs))
    assert found.pairs == tuple(without(*two) for two in combinations(range(inputs), 2))
    assert found.dead[0] == without(*range(inputs))
    assert found.dead[2] == without(*ends)
    for element, (counts, values) in enumerate(zip(found.stuck, found.values, strict=True)):
        for count, value in zip(counts, values, strict=True):
            stuck, asked = bits.copy(), codes.copy()
            if element < switches:
                stuck[:, element] = value == "closed"
            else:
                low = value.removeprefix("codes ").removeprefix("above ").split(" ")[0]
                asked[:, element - switches] = 0 if value == "any code" else int(low) + value.startswith("codes above")
            assert count == recognised(
                [scorer.biased_scores(*each) for each in zip(stuck, asked, strict=True)], labels, trials
            )


def test_two_joints_of_a_grid_may_decide_only_together() -> None:
    cells, none = np.array([[[0, 9], [9, 0]], [[9, 0], [9, 0]]], np.int16), np.empty(0, np.uint16)
    zeros, step = np.zeros((2, 2), np.int16), np.array([4], np.uint16)
    grid, rows = Grid((0, 1), (step, step), cells), (zeros[:1], zeros[:1])
    tables = IntegerTables.of(zeros[0], zeros[:0], (none, none), rows, zeros[:0], zeros, 1.0, (grid,))
    codes, labels = np.array([[9, 9]], np.uint16), np.zeros(1, np.intp)
    found = count_faults(tables, np.zeros((1, 0), bool), codes, labels, labels)
    assert (found.correct, found.lost, found.pairs) == (1, (1, 1), (0,))


def test_the_worst_fault_of_each_kind_names_its_inputs() -> None:
    random = np.random.default_rng(3)
    tables = tables_of(random, 3, 3, 1, slope=False)
    bits, codes = random.random((40, 3)) < 0.5, random.integers(0, 32, (40, 1)).astype(np.uint16)
    scan = ScanMap(
        1,
        (Port(0, 1, "GPIOA", ((0, 2),), False), Port(0, 1, "GPIOB", ((0, 0),), False)),
        (StreamRead(((4, 1),), ()),),
    )
    groups = groups_of(scan, ("a", "pad", "pad"), 1)
    assert groups == {
        "taxel pad": (1, 2),
        "port GPIOA of chip 2 of bus 1": (2,),
        "chip 2 of bus 1": (2, 0),
        "port GPIOB of chip 2 of bus 1": (0,),
        "stream 1": (1,),
        "the joints' device": (3,),
    }
    labels = random.integers(0, 3, 40)
    found = count_faults(tables, bits, codes, labels, np.arange(40), tuple(groups.values()))
    worst = worst_faults(found, ("a", "b", "c", "j"), groups)
    assert worst.lost is not None
    assert worst.pair is not None
    assert worst.dead is not None
    assert worst.stuck is not None
    assert worst.lost.elements == ("abcj"[found.lost.index(min(found.lost))],)
    assert worst.pair.elements == tuple(list(combinations("abcj", 2))[found.pairs.index(min(found.pairs))])
    assert worst.stuck.correct == min(min(counts) for counts in found.stuck)
    assert worst.dead.correct == min(found.dead)
    less = 100 * (found.correct - worst.lost.correct) / 40
    assert worst.sentences[0] == (
        f"{worst.lost.elements[0]} lost: {100 * worst.lost.correct / 40:.1f} % of trials, {less:.1f} points less"
    )


def test_pairs_of_very_many_inputs_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(faults, "_MOST", 100)
    random = np.random.default_rng(1)
    tables = tables_of(random, 3, 4, 0, slope=False)
    bits, none = random.random((20, 4)) < 0.5, np.zeros((20, 0), np.uint16)
    found = count_faults(tables, bits, none, random.integers(0, 3, 20), np.arange(20))
    assert found.pairs == ()
    assert worst_faults(found, "abcd", {}).pair is None
