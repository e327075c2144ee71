"""Tables of ensembles that hypothesis finds; and faults that are noticed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.boosting import stumps
from thenar.compiler.tables import collapse, quantise
from thenar.compiler.tables import quantise as balance
from thenar.runtime.tables import IntegerTables
from thenar.stability.cases import scoretables
from thenar.stability.cases import scoretables as hard_ensembles

SEEDS = st.integers(0, 2**32)


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.integers(1, 15))
def test_scores_tables_and_balanced_tables_are_within_what_rounding_allows(seed: int, rounds: int) -> None:
    rng = np.random.default_rng(seed)
    hard = list(hard_ensembles.ensembles(rng, 1, rounds))
    frames = hard_ensembles.frames(rng, 3)
    findings = [*scoretables.scores_of(hard, *frames), *scoretables.tables_of(hard)]
    findings += [scoretables.table_scores_of(hard, *frames), scoretables.balanced_of(hard)]
    assert not [finding for finding in findings if not finding.holds]


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_whole_steps_are_within_half_a_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hard = list(hard_ensembles.ensembles(rng, 1, 20))
    assert all(finding.holds for finding in scoretables.whole_steps_of(rng, hard))


def test_every_finding_notices_a_small_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def floored(*arguments: object) -> IntegerTables:
        integers = quantise.quantise(*arguments)  # type: ignore[arg-type]
        names = ("bias", "switch_rows", "switch_means", "joint_means")
        # Towards zero: no sum leaves its range.
        return replace(integers, **{name: getattr(integers, name) - np.sign(getattr(integers, name)) for name in names})

    def lost_bits(tables: collapse.ScoreTables) -> collapse.ScoreTables:
        single = tuple(rows.astype(np.float32).astype(np.float64) for rows in balance.balance(tables).joint_rows)
        return replace(balance.balance(tables), joint_rows=single)

    def collapse_off(of: stumps.Stumps, n_switches: int) -> collapse.ScoreTables:
        tables = collapse.collapse(of, n_switches)
        later = tuple(np.minimum(codes, 65533) + np.uint16(1) for codes in tables.thresholds)
        return replace(tables, bias=tables.bias * (1 + 2.0**-40), thresholds=later)

    monkeypatch.setattr(stumps, "centred", lambda answers, shrinkage: answers * shrinkage)
    monkeypatch.setattr(scoretables, "collapse", collapse_off)
    monkeypatch.setattr(scoretables, "balance", lost_bits)
    monkeypatch.setattr(scoretables, "quantise", floored)
    monkeypatch.setattr(collapse.ScoreTables, "scores", lambda self, bits, codes: np.tile(self.bias, (len(bits), 1)))
    assert not [finding.check for finding in scoretables.findings(False) if finding.holds]


def test_scores_that_are_added_without_compensation_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stumps, "add_exactly", lambda total, carry, term: (total + term, carry))
    drift = next(iter(scoretables.findings(False)))
    assert not drift.holds
