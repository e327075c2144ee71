"""Whatever `compile` writes holds its own `verify`: random sets of every kind of input, at both widths of tables."""

from itertools import cycle, islice
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from thenar.compiler import GraspSet, Joint, compile_build, verify
from thenar.runtime.recipe import TableBits

from ...sets import grasp_set_of

# Switches, joints and taxels of the sets.
KINDS = {
    "joints": (0, 4, 0),
    "switches": (7, 0, 0),
    "taxels": (0, 0, 3),
    "one joint": (0, 1, 0),
    "two types": (5, 2, 0),
    "all linear": (0, 3, 0),
    "empty tables": (0, 2, 0),
    "all inputs": (4, 2, 2),
}
LOGIT = {"penalty": 0.5, "smoothness": 1.0, "max_bins": 8}
TRAINERS: tuple[dict[str, Any], ...] = (
    {"trainer": "logit", **LOGIT},
    {"trainer": "logitboost", "rounds": 4},
    {"trainer": "pairs", "pairs": 2, "pair_bins": 4, **LOGIT},
    {"trainer": "discriminant", "max_bins": 8},
    {"trainer": "linear", "penalty": 0.5, "smoothness": 1.0, "sparsity": 0.5},
)
SEEDS = dict(enumerate(islice(cycle(KINDS), 68)))


def _random_set(seed: int, kind: str) -> GraspSet:
    """Return trials of one to three frames; in some sets some of them show an empty hand."""
    random, (switches, joints, taxels) = np.random.default_rng(seed), KINDS[kind]
    types = 2 if kind in {"two types", "empty tables"} else int(random.integers(2, 8))
    trials, frames = types * int(random.integers(3, 7)), int(random.integers(1, 4))
    labels, top = np.arange(trials) % types, int(random.choice([3, 200, 60_000]))
    # Without a difference between types, each trial of one has a twin of the other.
    shown = labels if kind != "empty tables" else 0 * labels
    empty = np.full(trials, kind != "empty tables" and random.random() < 0.5) & (np.arange(trials) >= trials - types)
    closed, centres = random.random((types, switches)) < 0.5, random.integers(0, top, (types, joints + taxels))
    closed[:2, :1], centres[:2, :1] = [[False], [True]], [[0], [top]]
    noise = np.rint(random.normal(0, 0.1 * top, (trials, joints + taxels)))
    if kind == "empty tables":
        noise = np.tile(np.arange(trials) // 2 % 3, (joints, 1)).T
    codes = centres[shown] + noise
    rows = np.repeat(np.arange(trials), frames)
    columns = [Joint(f"c{number}", "deg", 0, 0.0, 255, 127.5) for number in range(joints + taxels)]
    coded = np.clip(codes, 0, 65535).astype(np.uint16)[rows]
    return grasp_set_of(
        [f"g{number}" for number in range(types)],
        np.where(empty, types, labels)[rows],
        switches=closed[shown][rows] ^ (random.random((len(rows), switches)) < 0.1),
        codes=coded[:, :joints],
        joints=tuple(columns[:joints]),
        subjects=np.array([f"S{trial // types % 2}" for trial in range(trials)])[rows],
        trials=rows,
        taxels=coded[:, joints:],
        taxel_columns=tuple(columns[joints:]),
    )


def _holds(seed: int, folder: Path, table_bits: TableBits, firmware: tuple[str, ...] = ()) -> None:
    kind = SEEDS[seed]
    trainer = TRAINERS[-1 if kind == "all linear" else (seed + seed // len(KINDS)) % len(TRAINERS)]
    grasp_set = _random_set(seed, kind)
    made = compile_build(grasp_set, folder, folds=0, jobs=1, table_bits=table_bits, **trainer)
    assert (kind == "empty tables") == (made.tables.bound == 0)
    found = verify(folder, grasp_set, firmware)
    assert found.holds, (kind, trainer, found)


@pytest.mark.parametrize("table_bits", get_args(TableBits))
@pytest.mark.parametrize("seed", range(8), ids=SEEDS.get)
def test_a_build_of_each_kind_of_inputs_holds(seed: int, table_bits: TableBits, tmp_path: Path) -> None:
    _holds(seed, tmp_path / "build", table_bits)


@pytest.mark.slow
@pytest.mark.parametrize("table_bits", get_args(TableBits))
@pytest.mark.parametrize("seed", range(8, 68))
def test_random_builds_hold_and_some_in_c(seed: int, table_bits: TableBits, tmp_path: Path) -> None:
    in_c = seed < 28 and table_bits == get_args(TableBits)[seed // len(KINDS) % 2]
    _holds(seed, tmp_path / "build", table_bits, ("host",) if in_c else ())
