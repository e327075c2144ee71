from dataclasses import replace
from math import inf

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import softmax

from thenar.compiler.wearer import FREE, STRENGTH, STRENGTHS, Adaptation, correlations
from thenar.compiler.wearer_study import chosen_strength
from thenar.drivers.errors import SettingError
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.grid import Grid
from thenar.runtime.model.terms.line import Line

KINDS = ("bits", "bins", "lines", "grid")
Floats = NDArray[np.float64]


def tables_of(kind: str, random: np.random.Generator, K: int = 4) -> ScoreTables:
    steps = (np.array([60, 120, 180], np.uint16), np.array([100], np.uint16))
    plain, none = (np.zeros((1, K)), np.zeros((1, K))), (np.zeros(0, np.uint16),) * 2
    bias, switches = random.normal(size=K), random.normal(size=(5, K))
    if kind == "bits":
        return ScoreTables.of(bias, switches, none, plain)
    if kind == "bins":
        return ScoreTables.of(bias, switches, steps, tuple(random.normal(size=(len(each) + 1, K)) for each in steps))
    if kind == "grid":
        return ScoreTables.of(bias, switches, none, plain, [Grid((0, 1), steps, random.normal(size=(4, 2, K)))])
    lines = [Line(joint, 20, 220, random.normal(size=K) / 100) for joint in range(2)]
    return ScoreTables.of(bias, switches, none, plain, lines)


def adaptation(
    kind: str, seed: int = 0, trials: int = 12, frames: int = 2, strength: float = 1.0, new: range = range(0)
) -> Adaptation:
    """Return an adaptation to trials of four types, without and with the `new` ones."""
    random = np.random.default_rng(seed)
    n = trials * frames
    codes = random.integers(0, 256, (n, 2)).astype(np.uint16)
    labels = np.repeat(np.arange(trials) % 4, frames)
    tables = tables_of(kind, random, 4 - len(new))
    bits, trial = random.random((n, 5)) < 0.5, np.arange(n) // frames
    return Adaptation(tables, bits, codes, labels, trial, strength, (400,), new)


@pytest.mark.parametrize("kind", KINDS)
def test_without_a_limit_to_the_pull_nothing_changes(kind: str) -> None:
    mine = adaptation(kind, strength=1e9)
    near, far = (tables.scores(mine.bits, mine.codes) for tables in (mine.adapted, mine.tables))
    assert near == pytest.approx(far, abs=1e-6)
    assert adaptation(kind, strength=inf).adapted.scores(mine.bits, mine.codes).tolist() == far.tolist()


def free(mine: Adaptation) -> Floats:
    """How much less each type is pulled."""
    return np.where(np.isin(np.arange(4), mine.new), FREE, 1.0)


def loss(weights: Floats, mine: Adaptation) -> tuple[float, Floats]:
    """The penalised loss of a sum of kernels with these weights, and its gradient, on the frames in their order."""
    rows, root, kernel, start = mine._rows, mine._roots, mine._kernel, replace(mine, strength=inf).adapted
    n, K = len(rows), start.n_classes
    change = kernel @ weights.reshape(n, K)
    scores = start.scores(mine.bits[rows], mine.codes[rows]) + change
    top = scores.max(axis=1, keepdims=True)
    log_sum = top[:, 0] + np.log(np.exp(scores - top).sum(axis=1))
    losses = root[:, 0] ** 2 * (log_sum - scores[np.arange(n), mine.labels[rows]])
    off = root**2 * (np.exp(scores - log_sum[:, np.newaxis]) - np.eye(K)[mine.labels[rows]])
    pull = mine.strength / free(mine) * weights.reshape(n, K)
    return float(losses.sum() + 0.5 * (pull * change).sum()), (kernel @ (off + pull)).ravel()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("strength", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("new", [range(0), range(2, 3)])
def test_the_change_is_the_minimum_of_the_penalised_loss(kind: str, strength: float, new: range) -> None:
    mine = adaptation(kind, strength=strength, new=new)
    n, K = len(mine._rows), 4
    best = minimize(loss, np.zeros(n * K), args=(mine,), jac=True, method="L-BFGS-B", options={"maxiter": 5000})
    weights = mine._weights(mine._fitted, np.ones(n, bool))
    # What is common to all types changes no probability: the loss is least without.
    common = weights @ (1 / free(mine)) / (1 / free(mine)).sum()
    least, slope = loss((weights - common[:, np.newaxis]).ravel(), mine)
    assert least == pytest.approx(best.fun, abs=1e-4)
    assert np.abs(slope).max() < 1e-3
    # The tables say the same as the kernels.
    rows = mine._rows
    start = replace(mine, strength=inf).adapted
    by_kernels = start.scores(mine.bits[rows], mine.codes[rows]) + mine._kernel @ weights
    assert mine.adapted.scores(mine.bits[rows], mine.codes[rows]) == pytest.approx(
        by_kernels, abs=1e-4 * free(mine).max()
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("new", [range(0), range(1, 3)])
def test_neither_the_order_of_rows_nor_the_names_of_trials_matter(kind: str, new: range) -> None:
    mine = adaptation(kind, new=new)
    order = np.random.default_rng(1).permutation(len(mine.labels))
    columns = {name: getattr(mine, name)[order] for name in ("bits", "codes", "labels")}
    mixed = replace(mine, **columns, trials=99 - mine.trials[order])
    one, other = mine.adapted, mixed.adapted
    assert one.bias.tobytes() == other.bias.tobytes()
    assert one.switch_rows.tobytes() == other.switch_rows.tobytes()
    every = mine.bits, mine.codes
    assert one.scores(*every).tobytes() == other.scores(*every).tobytes()


def test_a_trial_counts_once_however_many_frames_it_has() -> None:
    mine = adaptation("bins", frames=1)
    rows = np.repeat(np.arange(12), [30] + 11 * [1])
    columns = {name: getattr(mine, name)[rows] for name in ("bits", "codes", "labels", "trials")}
    long = replace(mine, **columns).adapted
    assert long.scores(mine.bits, mine.codes) == pytest.approx(mine.adapted.scores(mine.bits, mine.codes), abs=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_a_type_without_trials_changes_as_the_others_do_on_average(kind: str) -> None:
    mine = adaptation(kind)
    some = mine.labels != 3
    columns = {name: getattr(mine, name)[some] for name in ("bits", "codes", "labels", "trials")}
    fewer = replace(mine, **columns)
    change = fewer.adapted.scores(mine.bits, mine.codes) - mine.tables.scores(mine.bits, mine.codes)
    assert np.abs(change).max() > 0.05
    assert change[:, 3] == pytest.approx(change[:, :3].mean(axis=1), abs=1e-4)
    one = replace(mine, **{name: getattr(mine, name)[mine.labels == 0] for name in columns})
    assert one.adapted.scores(mine.bits, mine.codes) == pytest.approx(mine.tables.scores(mine.bits, mine.codes))


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_type_starts_as_what_its_trials_were_taken_for(kind: str) -> None:
    mine = adaptation(kind, frames=3, strength=inf, new=range(1, 2))
    scores = mine.tables.scores(mine.bits, mine.codes)
    shares = softmax(scores[mine.labels == 1], axis=1).mean(axis=0)
    wider = np.insert(scores, 1, scores @ shares, axis=1)
    assert mine.adapted.scores(mine.bits, mine.codes) == pytest.approx(wider, abs=1e-4)


@pytest.mark.parametrize("new", [range(0), range(1, 2)])
def test_each_trial_is_left_out_once(new: range) -> None:
    mine = adaptation("lines", frames=1, new=new)
    kept = mine.trials != 5
    columns = {name: getattr(mine, name)[kept] for name in ("bits", "codes", "labels", "trials")}
    alone = replace(mine, **columns).adapted.scores(mine.bits[~kept], mine.codes[~kept])
    assert mine.left_out[~kept] == pytest.approx(alone, abs=0.02)


def test_without_its_only_trial_a_new_type_is_never_recognised() -> None:
    mine = adaptation("bits", trials=10, frames=1, new=range(3, 4))
    columns = {name: getattr(mine, name)[:4] for name in ("bits", "codes", "labels", "trials")}
    few = replace(mine, **columns)
    assert few.adapted.scores(few.bits, few.codes)[3].argmax() == 3
    assert few.left_out[3].argmax() != 3


def test_frames_of_two_types_are_named() -> None:
    mine = adaptation("bits", frames=1)
    bits, codes = mine.bits.copy(), mine.codes.copy()
    bits[1], codes[1] = bits[0], codes[0]
    assert replace(mine, bits=bits, codes=codes).contradictions == {(0, 1): {0, 1}}
    assert mine.contradictions == {}


def test_correlations_are_those_of_numpy() -> None:
    random = np.random.default_rng(0)
    codes = (random.normal(size=(50, 3)) @ random.normal(size=(3, 3)) * 50 + 30_000).astype(np.uint16)
    expected = np.asarray(np.corrcoef(codes.T))[np.tril_indices(3, -1)] * 1000
    assert correlations(codes) == pytest.approx(expected, abs=1)
    assert correlations(np.full((4, 2), 7, np.uint16)) == (0,)


def test_no_trials_and_too_many_are_refused() -> None:
    mine = adaptation("bits")
    none = {name: getattr(mine, name)[:0] for name in ("bits", "codes", "labels", "trials")}
    with pytest.raises(SettingError, match="no trials"):
        replace(mine, **none)
    with pytest.raises(SettingError, match="above 0"):
        replace(mine, strength=0.0)


def test_a_persons_rate_is_with_the_strength_that_suits_the_others() -> None:
    alone = [((9, 5, 5, 5), 10), ((5, 5, 5, 5), 10), ((5, 5, 5, 5), 10)]
    strength, (rate,) = chosen_strength(alone, 3, 1)
    assert (strength, rate.correct, rate.total) == (STRENGTHS[0], 15, 30)
    strength, (rate,) = chosen_strength([((5, 5, 7, 5), 10)] * 3, 3, 1)
    assert (strength, rate.correct) == (STRENGTHS[2], 21)
    assert chosen_strength([((50, 50, 51, 50), 100)] * 3, 3, 1)[0] == STRENGTH
    assert chosen_strength(alone[:2], 2, 1) == (STRENGTH, [])
