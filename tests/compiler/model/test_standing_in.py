"""What stands in for lost inputs: likelier than the mean rows, within bounds, in whatever order the rows come."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.model.collapse import collapse
from thenar.compiler.model.faults import _lack, fit_lost
from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.quantise import in_bytes, quantise

from .conftest import make_stumps

Rows = tuple[np.ndarray, np.ndarray, np.ndarray]
K, SWITCHES = 4, 6


def _rows(seed: int, n: int, joints: int) -> Rows:
    """Return bits, codes and labels: some switches close together, as a hand's do."""
    random = np.random.default_rng(seed)
    labels = random.integers(0, K, n)
    bits = random.random((n, SWITCHES)) < np.where(labels[:, np.newaxis] == np.arange(SWITCHES) // 2, 0.9, 0.1)
    bits[:, 1] = bits[:, 0] ^ (random.random(n) < 0.1)
    codes = random.integers(0, 60, (n, joints)) + 50 * labels[:, np.newaxis]
    return bits, codes.astype(np.uint16), labels


def _both(stumps: Stumps, rows: Rows) -> tuple[IntegerTables, IntegerTables]:
    """Return tables with mean rows, and with what is fitted."""
    tables = quantise(collapse(stumps, SWITCHES), rows[0], rows[1])
    return tables, fit_lost(tables, *rows)


def _loss(tables: IntegerTables, rows: Rows, switch: int) -> float:
    """Return the mean of -ln P(label) of all rows where a switch is lost."""
    bits, codes, labels = rows
    there = bits.astype(np.int64)
    there[:, switch] = 0
    scores = tables.joint_sums(codes) + there @ tables.switch_rows.astype(np.int64) + tables.switch_means[switch]
    scores = scores / tables.scale
    own = scores[np.arange(len(labels)), labels]
    return float((np.logaddexp.reduce(scores, axis=1) - own).mean())


@given(seed=st.integers(0, 100))
def test_a_lost_switch_leaves_the_rows_likelier_than_its_mean_row_does(seed: int) -> None:
    rows = _rows(seed, 200, joints=0)
    before, after = _both(make_stumps(seed, classes=K, switches=SWITCHES, joints=0), rows)
    losses = np.array([[_loss(tables, rows, switch) for switch in range(SWITCHES)] for tables in (before, after)])
    assert np.all(losses[1] <= losses[0] + 2 / before.scale)


def test_what_the_others_say_already_is_not_said_again() -> None:
    rows = _rows(1, 400, joints=0)
    tables, fitted = _both(make_stumps(3, rounds=60, classes=K, switches=SWITCHES, joints=0), rows)
    gains = [_loss(tables, rows, switch) - _loss(fitted, rows, switch) for switch in range(SWITCHES)]
    assert max(gains) > 0.05


@given(seed=st.integers(0, 100), n=st.integers(1, 60), joints=st.integers(0, 3))
def test_what_stands_in_lies_within_what_the_input_adds(seed: int, n: int, joints: int) -> None:
    before, after = _both(make_stumps(seed, classes=K, switches=SWITCHES, joints=joints), _rows(seed, n, joints))
    rows = before.switch_rows
    assert np.all((np.minimum(rows, 0) <= after.switch_means) & (after.switch_means <= np.maximum(rows, 0)))
    for joint, mean in enumerate(after.joint_means):
        added = before.choices(joint)[1]
        assert np.all((added.min(axis=0) <= mean) & (mean <= added.max(axis=0)))
    assert (after.bound, after.scale) == (before.bound, before.scale)


def test_neither_is_it_where_millions_of_rows_are_added_up() -> None:
    random = np.random.default_rng(5)
    scores, often = random.integers(-900, 900, (300, K)), random.integers(1, 1_000_000, 300).astype(np.float64)
    wanted = np.full(K, often.sum() / K)
    for _ in range(20):
        order = random.permutation(300)
        assert np.array_equal(_lack(scores, often, wanted, 300.0), _lack(scores[order], often[order], wanted, 300.0))


@given(seed=st.integers(0, 30))
def test_inputs_that_add_nothing_change_nothing_for_the_others(seed: int) -> None:
    bits, codes, labels = _rows(seed, 200, joints=1)
    scores = collapse(make_stumps(seed, classes=K, switches=SWITCHES, joints=1), SWITCHES)
    tables = quantise(scores, bits, codes, width=15)
    fitted = fit_lost(tables, bits, codes, labels)
    none, constant = np.zeros((1, K), np.int16), np.full((1, K), 7, np.int16)
    more = tables.changed(
        switch_rows=np.vstack([none, tables.switch_rows]),
        switch_means=np.vstack([none, tables.switch_means]),
        thresholds=(*tables.thresholds, np.zeros(0, np.uint16)),
        joint_rows=(*tables.joint_rows, constant),
        joint_means=np.vstack([tables.joint_means, constant]),
        bias=(tables.bias - 7).astype(np.int16),
    )
    silent = np.zeros((len(labels), 1))
    again = fit_lost(more, np.hstack([silent > 0, bits]), np.hstack([codes, silent.astype(np.uint16)]), labels)
    assert np.array_equal(again.switch_means, np.vstack([none, fitted.switch_means]))
    assert np.array_equal(again.joint_means, np.vstack([fitted.joint_means, constant]))


@given(seed=st.integers(0, 1000), reach=st.sampled_from([1, 90, 800]), joints=st.integers(0, 3))
def test_bytes_hold_means_that_are_the_nearest_within_what_the_input_adds(seed: int, reach: int, joints: int) -> None:
    stumps = make_stumps(seed, rounds=1 + reach // 8, classes=K, switches=SWITCHES, joints=joints)
    before, fitted = _both(stumps, _rows(seed, 60, joints))
    after, units = in_bytes(fitted), 1 << fitted.missing_shifts
    steps, rest = np.divmod(after.missing, units[:, np.newaxis])
    assert not rest.any()
    assert np.abs(steps).max() <= 127
    assert np.all(after.missing_shifts <= fitted.missing_shifts)
    possible = [np.stack([0 * row, row]).astype(np.int64) for row in fitted.switch_rows]
    possible += [fitted.choices(joint)[1] for joint in range(joints)]
    zeros = [row[0] for row in possible]
    for row, zero, unit, mean, short in zip(possible, zeros, units, fitted.missing, after.missing, strict=True):
        allowed = np.arange(-127, 128)[:, np.newaxis] * unit
        inside = (row.min(axis=0) - zero <= allowed) & (allowed <= row.max(axis=0) - zero)
        apart = np.where(inside, np.abs(allowed - mean), 1 << 20)
        assert np.array_equal(np.abs(short - mean), apart.min(axis=0))
    again = in_bytes(after)
    assert np.array_equal(again.missing, after.missing)
    assert after.bound == before.bound
