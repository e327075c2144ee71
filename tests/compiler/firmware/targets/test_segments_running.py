"""The decoder of segments beside the classifier, in C and MicroPython: Python's state at every frame of streams."""

from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.probes import STREAM_TICKS, Lost, Predictions, Probes, joined, states_of
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.build import Build
from thenar.runtime.manifest import Manifest, Rejection
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.published import NONE
from thenar.runtime.scores import LANE_OFFSET
from thenar.runtime.segmenting.model import SegmentModel

from ....conftest import tool
from ....tables import describe
from ..conftest import make_tables

KINDS = ("host", "micropython", *(pytest.param(core, marks=pytest.mark.slow) for core in ("cortex-m0plus", "rv32imac")))
Running = Callable[..., Predictions]
TICKS = 3 * STREAM_TICKS + 77  # several streams, the last without its end


@pytest.fixture(params=KINDS)
def running(request: pytest.FixtureRequest) -> Running:
    """Return what runs a manifest's classifier on frames, of which some inputs may be lost."""
    target = TARGETS[request.param]
    runs = target if target.kind else request.getfixturevalue("cores")[target.name]
    if missing := runs.missing():
        tool(missing.split()[0])

    def run(manifest: Manifest, tables: IntegerTables, frames: Probes, lost: Lost | None) -> Predictions:
        layout = Layout(tables)
        library = Library("hand", manifest, layout)
        files = target.sources(library) if target.kind else library.files | library.segments
        sent = layout.frame_bytes(frames.bits, frames.codes)
        found: Predictions = runs.run(files, "hand", layout, sent, lost=lost)
        return found

    return run


def movements(tables: IntegerTables, seed: int) -> tuple[Probes, Lost]:
    """Return frames of a hand that holds still for a while, trembles, and moves on; inputs are missing at times."""
    random, still = np.random.default_rng(seed), 30
    holds = -(-TICKS // still)
    bits = np.repeat(random.random((holds, tables.n_switches)) < 0.4, still, axis=0)[:TICKS]
    codes = np.repeat(random.integers(0, 256, (holds, tables.n_joints)), still, axis=0)[:TICKS]
    lost = np.repeat(random.random((holds, tables.n_switches + tables.n_joints)) < 0.2, still, axis=0)[:TICKS]
    lost[np.arange(TICKS) // still % 3 > 0] = False
    lost[-9:] = True
    return Probes(bits ^ (random.random(bits.shape) < 0.02), codes.astype(np.uint16)), lost


def model_of(tables: IntegerTables, knows_none: bool, seed: int) -> SegmentModel:
    """Return costs that differ from state to state, with some shortest durations in common."""
    types, random = tables.n_classes - knows_none, np.random.default_rng(seed)

    def costs(low: int, high: int, n: int = types) -> tuple[int, ...]:
        return tuple(random.integers(low, high, n).tolist())

    return replace(
        SegmentModel.usual(types, knows_none, tables.scale),
        least=(*random.choice([1, 3, 3, 9, 20], types).tolist(), 4),
        stay=costs(0, 4, types + 1),
        enter=costs(20, 90),
        leave=costs(10, 60),
        direct=costs(40, 200),
    )


def scores_of(build: Build, frames: Probes, lost: Lost) -> NDArray[np.int64]:
    s, without = build.tables.n_switches, build.scorer.biased_scores
    held = zip(frames.bits, frames.codes, lost, strict=True)
    return np.array([without(bits, codes, row[:s], row[s:]) for bits, codes, row in held]) - LANE_OFFSET


def described(tables: IntegerTables, kind: str) -> Manifest:
    """Return a manifest with costs of segments, and a class "none", a rejection of some of the frames, or neither."""
    manifest = replace(describe(tables), segments=model_of(tables, kind == "class none", 5))
    n, j = tables.n_classes, tables.n_joints
    if kind == "class none":
        return replace(manifest, grasps=(*manifest.grasps[:-1], NONE))
    if kind == "neither":
        return manifest
    rejection = Rejection(0.1, (-300,) * n, ((2, 6),) * n, (((10, 240),) * j,) * n, 1)
    return replace(manifest, rejection=rejection)


@pytest.mark.parametrize("kind", ["class none", "refusals", "neither"])
def test_every_state_is_python_s_with_missing_inputs_ends_and_restarts(running: Running, kind: str) -> None:
    tables = make_tables(seed=4, classes=6, reach=60)
    manifest = described(tables, kind)
    assert manifest.segments is not None
    frames, lost = movements(tables, 8)
    frames, lost = joined(frames, frames), np.vstack([np.zeros_like(lost), lost])
    found = running(manifest, tables, frames, lost)
    scores = scores_of(Build(manifest, tables), frames, lost)
    assert np.array_equal(found.scores, scores)
    refused = found.classes == tables.n_classes
    expected = states_of(manifest.segments, scores, refused)
    assert found.states is not None
    np.testing.assert_array_equal(found.states, expected)
    for half in (slice(TICKS), slice(TICKS, None)):
        assert refused[half].any() == (kind == "refusals")
        assert len(set(expected[half].tolist())) > 3


def test_a_build_without_costs_of_segments_has_no_decoder(running: Running) -> None:
    tables = make_tables()
    frames, _ = movements(tables, 1)
    assert running(describe(tables), tables, frames, None).states is None
