"""Firmware of tables with pairs of joints: look-ups of both, exact to the bit, and counted to the cycle on an AVR."""

from collections.abc import Callable

import numpy as np
import pytest

from thenar.compiler.firmware.avr_costs import AvrCosts, rises, worst_frame
from thenar.compiler.firmware.choose import fit_for
from thenar.compiler.firmware.classifier import Library, classifier_files
from thenar.compiler.firmware.layout import Shared, arrange
from thenar.compiler.firmware.measuring import measure
from thenar.compiler.firmware.one_hand import on_bytes
from thenar.compiler.firmware.probes import changing_frames, extreme_frames, joined, lost_inputs, random_frames
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.words import numbered
from thenar.compiler.tables.quantise import integer_scores
from thenar.runtime.scores import LANE_OFFSET, Scorer
from thenar.runtime.tables import IntegerTables, Pair

Tool = Callable[[str], str]
# Classes, switches, whether codes are wide.
SHAPES = {"bytes": (5, 7, False), "wide codes": (4, 5, True), "parts": (17, 3, False), "joints alone": (3, 0, False)}
EACH = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
JOINTS = 5


def _tables(seed: int, shape: tuple[int, int, bool]) -> IntegerTables:
    """Of five joints, pairs of four: one joint has no bins of its own, and one pair but one bin of a joint."""
    classes, switches, wide = shape
    random = np.random.default_rng(seed)
    first = 300 if wide else 0

    def rows(*size: int) -> np.ndarray:
        return random.integers(-20, 21, size).astype(np.int16)

    def thresholds(count: int) -> np.ndarray:
        return np.sort(random.choice(200, count, replace=False) + first).astype(np.uint16)

    steps = tuple(thresholds(count) for count in (3, 8, 0, 2, 4))
    pairs = []
    for joints, counts in (((0, 3), (7, 4)), ((1, 2), (0, 9))):
        one, other = (thresholds(count) for count in counts)
        pairs.append(Pair(joints, (one, other), rows(len(one) + 1, len(other) + 1, classes)))
    own = tuple(rows(len(each) + 1, classes) for each in steps)
    means = rows(switches, classes), rows(JOINTS, classes)
    return IntegerTables(rows(classes), rows(switches, classes), steps, own, *means, 100.0, (), tuple(pairs))


def _is_exact(tables: IntegerTables, name: str, entry_bits: int, shared: tuple[Shared, ...] = ()) -> None:
    layout = arrange(tables, entry_bits=entry_bits, bins="trimmed", shared=shared)
    frames = joined(extreme_frames(tables), random_frames(tables, 60, 1), changing_frames(tables))
    worst_bits, worst_codes = worst_frame(layout)
    bits, codes = np.vstack([frames.bits, worst_bits]), np.vstack([frames.codes, worst_codes])
    target, expected = TARGETS[name], integer_scores(tables, bits, codes)
    assert np.array_equal(layout.scores(bits, codes), expected)
    cost, lost = target.cost(layout), lost_inputs(tables, len(bits), 1)
    files = classifier_files("hand", numbered(tables), layout, avr=target.avr)
    held, scorer = layout.frame_bytes(bits, codes), Scorer(tables)
    whole_and_lost = np.vstack([np.zeros_like(lost), lost])
    s = tables.n_switches
    without = [scorer.lanes_without(b, c, m[:s], m[s:]) for b, c, m in zip(bits, codes, lost, strict=True)]
    for incremental, most in ((False, cost.cycles), (True, cost.update_cycles)):
        twice = target.run(files, "hand", layout, np.vstack([held, held]), incremental=incremental, lost=whole_and_lost)
        assert np.array_equal(twice.scores, np.vstack([expected, np.array(without) - LANE_OFFSET]))
        if not target.avr:
            continue
        answers = target.run(files, "hand", layout, held, incremental=incremental)
        assert np.array_equal(answers.scores, expected)
        assert answers.cost is not None
        assert answers.cost.max() <= most
        if not incremental:
            costs = AvrCosts(layout, target.flash)
            assert np.array_equal(answers.cost, costs.fixed_cycles + rises(layout, bits, codes))


@EACH
@pytest.mark.parametrize("entry_bits", [8, 16])
def test_in_portable_c_scores_are_python_s(tool: Tool, shape: tuple[int, int, bool], entry_bits: int) -> None:
    tool("cc")
    _is_exact(_tables(3, shape), "host", entry_bits)


@EACH
def test_on_an_avr_scores_are_python_s_and_cycles_the_model_s(tool: Tool, shape: tuple[int, int, bool]) -> None:
    tool("avr-gcc")
    _is_exact(_tables(0, shape), "avr328p", 16)


def test_a_pair_shares_a_look_up_with_switches_or_another_joint(tool: Tool) -> None:
    tool("avr-gcc")
    tables = _tables(2, SHAPES["bytes"])
    for shared in (((0, (JOINTS + 1,)),), ((None, (4, JOINTS)),)):
        assert len(arrange(tables, shared=shared).lookups) == len(arrange(tables).lookups) - 1
        _is_exact(tables, "avr328p", 16, shared)


@EACH
def test_flash_and_ram_are_within_the_bound_and_no_look_up_sees_a_joint_twice(
    tool: Tool, shape: tuple[int, int, bool]
) -> None:
    tool("avr-gcc")
    tables = _tables(5, shape)
    fit = fit_for(TARGETS["avr328p"], tables)
    for layout, _ in fit.choice.frontier:
        seen = [[joint.number for joint in lookup.joints] for lookup in layout.lookups]
        assert all(len(set(joints)) == len(joints) for joints in seen)
    assert measure(Library("hand", numbered(tables), fit.choice.layout, avr=True), fit).holds


def test_a_glove_s_bytes_have_the_rows_of_their_codes_and_byte_0_is_a_missing_joint() -> None:
    tables = _tables(4, (5, 3, True))
    random = np.random.default_rng(0)
    codes = [np.sort(random.integers(280, 520, 256))[:: (-1) ** joint].tolist() for joint in range(JOINTS)]
    of_bytes = on_bytes(tables, codes)
    frames = random_frames(of_bytes, 300, 1)
    sent = np.maximum(frames.codes, 1)
    meant = np.stack([np.array(codes[joint])[sent[:, joint]] for joint in range(JOINTS)], axis=1).astype(np.uint16)
    assert np.array_equal(integer_scores(of_bytes, frames.bits, sent), integer_scores(tables, frames.bits, meant))
    one, other = Scorer(of_bytes), Scorer(tables)
    lost = random.random((300, JOINTS)) < 0.5
    for bits, byte, code, missing in zip(frames.bits, sent, meant, lost, strict=True):
        here, there = (each.lanes_without(bits, x, [False] * 3, missing) for each, x in ((one, byte), (other, code)))
        assert here == there
