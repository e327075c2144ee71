from collections import Counter

import numpy as np
import pytest

from thenar.simulator.pipeline.report import (
    GraspReport,
    Notes,
    Rows,
    StepCount,
    UnsettledGrasp,
    grasp_reports,
    step_reports,
)
from thenar.simulator.pipeline.steps import Ledger
from thenar.simulator.streams import DrawCounts

ONE = UnsettledGrasp("A", "Tip", "pin", 3, 17, "the hand did not come to rest")


def rows_with(closed: list[list[int]], read_out: list[bool] | None = None) -> Rows:
    """Return rows whose closed switches are given."""
    bits = np.zeros((len(closed), 160), dtype=bool)
    for row, switches in enumerate(closed):
        bits[row, switches] = True
    numbers = np.arange(len(closed), dtype=np.uint32)
    return Rows(
        bits=np.packbits(bits, axis=1),
        codes=np.zeros((len(closed), 16), dtype=np.uint16),
        taxels=np.zeros((len(closed), 0), dtype=np.uint16),
        condition=np.zeros(len(closed), dtype=np.uint32),
        trial=numbers,
        read_out=np.array(read_out or [True] * len(closed), dtype=bool),
        held=np.ones(len(closed), dtype=bool),
        time_us=np.zeros(len(closed), dtype=np.int64),
    )


def notes(grasp: str, repetitions: int, *unsettled: UnsettledGrasp, residual_n: float = 0.0) -> Notes:
    return Notes(grasp, repetitions, unsettled, residual_n, 10 * residual_n, 8 * residual_n, 0)


def test_switches_patterns_and_grasps_without_contact_are_counted_by_grasp_type() -> None:
    rows = rows_with([[1, 2, 3], [1, 2, 3], [], [159], [5, 6]])
    made = [notes("PoS", 4), notes("Tip", 2, ONE, residual_n=0.25), notes("Tip", 1, residual_n=0.125)]
    grasps = np.array([0, 0, 0, 1, 1])
    assert grasp_reports(rows, grasps, ("PoS", "Tip"), made) == (
        GraspReport("PoS", 4, 3, 0, 2.0, 0, 3, 2, 1, 0.0, 0.0, 0.0),
        GraspReport("Tip", 3, 2, 1, 1.5, 1, 2, 2, 0, 0.25, 2.5, 1.5),
    )


def test_only_rows_that_are_read_out_tell_of_switches() -> None:
    rows = rows_with([[], [], [4]], [False, False, True])
    (found,) = grasp_reports(rows, np.zeros(3, dtype=np.intp), ("PoS",), [notes("PoS", 1)])
    assert (found.rows, found.switches_mean, found.patterns, found.no_contact) == (3, 1.0, 1, 0)


def test_steps_are_reported_in_their_order_with_their_share_of_the_time() -> None:
    ledger = Ledger()
    ledger.enter("glove.recall", True, 1, 10, 1_000_000, DrawCounts())
    for _ in range(2):
        drawn = DrawCounts(Counter({"joint.noise": 40, "bytes sent": 3, "a": 1}))
        ledger.enter("joint.noise", False, 1, 10, 1_500_000, drawn)
    recall, noise = step_reports(ledger)
    assert (recall.name, recall.own, recall.us_a_grasp, recall.share) == ("glove.recall", True, 100.0, 0.25)
    assert (noise.calls, noise.grasps, noise.draws, noise.own) == (2, 20, 80, False)
    assert (noise.seconds, noise.us_a_grasp, noise.share) == pytest.approx((0.003, 150.0, 0.75))
    assert noise.counts == (StepCount("a", 2), StepCount("bytes sent", 6))
