"""The formulas of the targets' costs, against simulators and the sizes of toolchains, on builds that they never saw."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.firmware.targets import TARGETS

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
# Of the draws from here on, none is fitted.
UNSEEN, BUILDS = 2000, 50
WITHIN = 0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["avr328p", "avr2560", "cortex-m0plus", "cortex-m4", "rv32imac"])
def test_costs_of_fifty_builds_are_near_those_of_the_formula(cores: Any, name: str) -> None:
    sys.path.append(str(BENCHMARKS))
    from firmwarefit import errors, measured

    target = TARGETS[name]
    points: list[Any] = []
    assert target.formula is not None
    for seed in range(UNSEEN, UNSEEN + 2 * BUILDS):
        if len(points) < BUILDS and (point := measured(name, seed)) is not None:
            points.append(point)
    assert len(points) == BUILDS
    for part, found in errors(target.formula, points, avr=target.avr).items():
        print(f"{name}, {part}: {100 * np.abs(found).mean():.1f} %, at most {100 * np.abs(found).max():.1f} %")
        assert np.abs(found).max() < WITHIN, part
