"""Integer tables and manifests of any size, without training anything, and what Python answers by them."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.firmware.probes import Lost, Predictions, Probes, extreme_frames, joined, random_frames
from thenar.compiler.firmware.softmax import Softmax
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.build import Build
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.quantise import in_bytes
from thenar.runtime.scores import LANE_OFFSET

from ...conftest import tool
from ...tables import describe


def make_tables(
    seed: int = 0,
    classes: int = 5,
    switches: int = 9,
    joints: int = 3,
    bins: int = 6,
    reach: int = 20,
    highest: int = 254,
) -> IntegerTables:
    """Return random tables: entries -reach..reach, `bins` rows a joint, thresholds 0..highest, the highest one used."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-reach, reach + 1, shape).astype(np.int16)

    def thresholds() -> np.ndarray:
        return np.sort(np.append(random.choice(highest, bins - 2, replace=False), highest)).astype(np.uint16)

    tables = IntegerTables.of(
        bias=rows(classes),
        switch_rows=rows(switches, classes),
        thresholds=tuple(thresholds() for _ in range(joints)),
        joint_rows=tuple(rows(bins, classes) for _ in range(joints)),
        switch_means=rows(switches, classes),
        joint_means=rows(joints, classes),
        scale=100.0,
    )
    return in_bytes(tables)


@pytest.fixture(scope="session")
def build() -> Build:
    tables = make_tables()
    return Build(describe(tables), tables)


@pytest.fixture(scope="session")
def cores() -> Any:
    """Return the emulated cores of tests/qemu by the names of their targets."""
    for name in ("arm-none-eabi-gcc", "qemu-system-arm", "riscv64-unknown-elf-gcc", "qemu-system-riscv32"):
        tool(name)
    sys.path.append(str(Path(__file__).parents[2] / "qemu"))
    return import_module("qemu").CORES


def probed(tables: IntegerTables, n: int) -> Probes:
    """Return every extreme frame of tables and n random ones."""
    return joined(extreme_frames(tables), random_frames(tables, n, seed=1))


def same_as_python(answers: Predictions, tables: IntegerTables, frames: Probes, lost: Lost | None = None) -> None:
    """Compare every score and class with those of a Build, which inputs are `lost` to."""
    without = Build(describe(tables), tables).scorer.biased_scores
    s = tables.n_switches
    gone = np.zeros((len(frames), s + tables.n_joints), bool) if lost is None else lost
    held = zip(frames.bits, frames.codes, gone, strict=True)
    scores = np.array([without(bits, codes, row[:s], row[s:]) for bits, codes, row in held]) - LANE_OFFSET
    assert np.array_equal(answers.scores, scores)
    assert np.array_equal(answers.classes, scores.argmax(axis=1))
    if answers.margins is not None and answers.shares is not None:
        best, second = np.sort(scores, axis=1)[:, :-3:-1].T
        assert np.array_equal(answers.margins, best - second)
        softmax = Softmax(tables.scale)
        shares = [softmax.probabilities(own)[n % len(own)] for n, own in enumerate(scores.tolist())]
        assert answers.shares.tolist() == shares


@pytest.fixture
def avr() -> None:
    """Need an AVR's compiler and simulator."""
    tool("avr-gcc")
    if TARGETS["avr328p"].missing() is not None:
        tool("libsimavr-dev")
