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
# Compilers of 32-bit cores optimise in ways that no sum of terms follows, above all for the smallest builds: a frame of
# fewer instructions counts as one of LEAST.
WITHIN = {"avr328p": 0.1, "avr2560": 0.1, "cortex-m0plus": 0.2, "cortex-m4": 0.2, "rv32imac": 0.25}
LEAST = 700


@pytest.mark.slow
@pytest.mark.parametrize("name", WITHIN)
def test_costs_of_fifty_builds_are_near_those_of_the_formula(cores: Any, name: str) -> None:
    sys.path.append(str(BENCHMARKS))
    from firmwarefit import drawn, errors, measured

    formula = TARGETS[name].formula
    assert formula is not None
    points: list[Any] = []
    for seed in range(UNSEEN, UNSEEN + 2 * BUILDS):
        if len(points) < BUILDS and (point := measured(name, drawn(seed))) is not None:
            points.append(point)
    assert len(points) == BUILDS
    for part, coefficients in (("time", formula.cycles), ("flash", formula.flash), ("ram", formula.ram)):
        values = [int(getattr(point, part)) for point in points]
        found = np.abs(errors(coefficients, points, values))
        if part == "time" and not TARGETS[name].avr:
            found *= np.array(values) / np.maximum(values, LEAST)
        print(f"{name}, {part}: {100 * found.mean():.1f} %, at most {100 * found.max():.1f} %")
        assert found.mean() < 0.07, part
        assert found.max() < WITHIN[name], part
