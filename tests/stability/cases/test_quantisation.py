"""Rounded scores against 60 digits, and decided as in C: real C, in accumulators of 16 bits."""

import subprocess
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.tables.compare import float_slack
from thenar.compiler.tables.worstcase import Rounding
from thenar.runtime.scores import LANE_OFFSET, Scorer
from thenar.runtime.tables import IntegerTables
from thenar.stability.cases.quantisation import LAST, BothWays, edge_tables, lost
from thenar.stability.checks.integer_sums import first_best
from thenar.stability.inputs.hard_tables import (
    Quantised,
    dominated,
    drawn,
    every_frame,
    half_a_step_off,
    quantised,
    whole_numbers,
)
from thenar.stability.reference.numbers import precisely, ratio

Frames = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # bits, lost switches, codes, lost joints
RunC = Callable[[IntegerTables, Frames], "subprocess.CompletedProcess[bytes]"]

SANITIZED = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-ftrapv", "-fsanitize=undefined",
             "-fno-sanitize-recover=all")  # fmt: skip


@pytest.fixture(scope="module")
def run_c(c_compiler: str, tmp_path_factory: pytest.TempPathFactory) -> RunC:
    program = tmp_path_factory.mktemp("c") / "scorer"
    source = Path(__file__).with_name("scorer.c")
    subprocess.run([c_compiler, *SANITIZED, "-o", str(program), str(source)], check=True)

    def run(tables: IntegerTables, frames: Frames) -> "subprocess.CompletedProcess[bytes]":
        bits, lost_switches, codes, lost_joints = frames
        sizes = [tables.n_classes, tables.n_switches, tables.n_joints, len(bits), *map(len, tables.thresholds)]
        arrays = [tables.bias, tables.switch_rows, tables.switch_means, tables.joint_means]
        words = [np.array(sizes, np.uint16), *arrays, *tables.thresholds, *tables.joint_rows]
        for frame in zip(bits, lost_switches, codes, lost_joints, strict=True):
            words += [np.asarray(part, np.uint16) for part in frame]
        data = b"".join(array.tobytes() for array in words)
        return subprocess.run([program], input=data, capture_output=True, check=False)

    return run


def _in_c(run_c: RunC, tables: IntegerTables, frames: Frames) -> tuple[list[list[int]], list[int]]:
    done = run_c(tables, frames)
    assert done.returncode == 0, done.stderr
    answers = np.frombuffer(done.stdout, np.int16).reshape(len(frames[0]), tables.n_classes + 1)
    return answers[:, :-1].tolist(), answers[:, -1].tolist()


def _in_python(tables: IntegerTables, frames: Frames) -> tuple[list[list[int]], list[int]]:
    scorer = Scorer(tables)
    lanes = [scorer.lanes_without(bits, codes, *lost) for bits, *lost, codes in _reordered(frames)]
    return [[lane - LANE_OFFSET for lane in of] for of in lanes], [of.index(max(of)) for of in lanes]


def _reordered(frames: Frames) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    bits, lost_switches, codes, lost_joints = frames
    return list(zip(bits, lost_switches, lost_joints, codes, strict=True))


def _all_frames(tables: IntegerTables) -> Frames:
    bits, codes = zip(*every_frame(tables), strict=True)
    shape = len(bits), -1
    there = np.array(bits, bool).reshape(shape), np.array(codes, np.uint16).reshape(shape)
    return there[0], np.zeros_like(there[0]), there[1], np.zeros(there[1].shape, bool)


def _with_gaps(tables: IntegerTables, seed: int) -> Frames:
    bits, _, codes, _ = _all_frames(tables)
    random = np.random.default_rng(seed)
    return bits, random.random(bits.shape) < 0.3, codes, random.random(codes.shape) < 0.3


small = st.builds(
    whole_numbers,
    st.integers(0, 10_000),
    st.integers(2, 5),
    st.integers(0, 4),
    st.lists(st.integers(1, 4), max_size=2).map(tuple),
    st.sampled_from([1, 2, 4000]),
)


@settings(deadline=None, max_examples=60)
@given(tables=small, seed=st.integers(0, 99))
def test_c_scores_and_decides_every_frame_as_python_does(run_c: RunC, tables: IntegerTables, seed: int) -> None:
    for frames in (_all_frames(tables), _with_gaps(tables, seed)):
        assert _in_c(run_c, tables, frames) == _in_python(tables, frames)


def test_of_equal_scores_c_and_python_take_the_first(run_c: RunC) -> None:
    tied = 0
    for seed in range(10):
        tables = whole_numbers(seed, 6, 4, (3, 2), 1)
        frames = _all_frames(tables)
        scores, winners = _in_c(run_c, tables, frames)
        assert winners == _in_python(tables, frames)[1] == [first_best(of) for of in scores]
        tied += sum(of.count(max(of)) > 1 for of in scores)
    assert tied > 100


@pytest.mark.parametrize("width", range(4, 17))
def test_c_agrees_on_what_the_compiler_quantises(run_c: RunC, width: int) -> None:
    for tables in (drawn(width, 4, 4, (4, 3)), dominated(width, 4, 4, (4, 3), 1e4)):
        integers = quantised("", tables, width).integers
        frames = _with_gaps(integers, width)
        assert _in_c(run_c, integers, frames) == _in_python(integers, frames)


@pytest.mark.parametrize(("sign", "last"), list(product((1, -1), [array for _, array in LAST])))
def test_c_reaches_the_edge_of_int16_and_not_beyond(run_c: RunC, sign: int, last: str) -> None:
    tables = edge_tables(3, sign, last)
    gap = np.array([[last == "switch_means"]]), np.array([[last == "joint_means"]])
    frames = (np.ones((1, 1), bool), gap[0], np.zeros((1, 1), np.uint16), gap[1])
    assert _in_c(run_c, tables, frames)[0] == [[-32767 * sign, 32767 * sign, -32767 * sign]]
    two_too_far = tables.switch_means if last == "switch_means" else tables.switch_rows
    two_too_far += np.array([0, 2 * sign, 0], np.int16)
    assert run_c(tables, frames).returncode != 0, "the C of this test does not notice an overflow"


@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    classes=st.integers(2, 8),
    switches=st.integers(0, 20),
    bins=st.lists(st.integers(1, 12), max_size=4).map(tuple),
    decades=st.sampled_from([0.0, 1.0, 3.0]),
    width=st.integers(4, 16),
)
def test_the_worst_frame_run_through_scorer_and_reference_loses_exactly_what_was_computed(
    seed: int, classes: int, switches: int, bins: tuple[int, ...], decades: float, width: int
) -> None:
    case = quantised("", drawn(seed, classes, switches, bins, decades), width, seed)
    rounding, both = Rounding(case.tables, case.integers), BothWays(case.tables, case.integers)
    frame = rounding.worst_of_all()
    most = ratio(frame.loss)
    with precisely():
        assert lost(*both.run(frame.bits.tolist(), frame.codes.tolist()), frame.leader, frame.competitor) == most
        assert most <= switches + len(bins) + 1 + 2 * float_slack(case.tables, case.integers.scale)
        for bits, codes in _drawn_frames(case, seed):
            assert lost(*both.run(bits, codes), frame.leader, frame.competitor) <= most


def _drawn_frames(case: Quantised, seed: int) -> list[tuple[list[bool], list[int]]]:
    random = np.random.default_rng(seed)
    bits = random.random((30, case.integers.n_switches)) < 0.5
    codes = random.integers(0, 257, (30, case.integers.n_joints))
    return list(zip(bits.tolist(), codes.tolist(), strict=True))


@settings(deadline=None, max_examples=25)
@given(switches=st.integers(1, 100), width=st.integers(9, 16))
def test_rows_half_a_step_off_reach_the_bound_exactly(switches: int, width: int) -> None:
    case = quantised("", half_a_step_off(switches, 2 ** (width - 1) - 1), width)
    assert case.integers.scale == 1.0
    worst = Rounding(case.tables, case.integers).worst_of_all()
    assert worst.loss == switches + 1
    assert worst.bits.all()
