"""The formulas of costs, against simulators and toolchains, on builds that they never saw; and what they choose."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.costs import estimate, fit_for, smallest_fit
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.model.integers import IntegerTables

from .conftest import make_tables

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


SMALL = TARGETS["avr328p"]


@pytest.fixture(scope="module")
def tables() -> IntegerTables:
    return make_tables(1, classes=14, switches=33, joints=16, bins=16, reach=12)


@pytest.fixture(scope="module")
def wide_tables() -> IntegerTables:
    return make_tables(1, classes=14, switches=33, joints=16, bins=16, reach=300)


def test_switches_share_look_ups_where_there_is_flash_for_it(tables: IntegerTables) -> None:
    small, wide = make_tables(switches=8, joints=0), make_tables(classes=30, switches=64, joints=0)
    assert [fit_for(SMALL, each).layout.group for each in (small, tables, wide)] == [4, 4, 1]
    assert fit_for(TARGETS["avr2560"], tables).layout.group == 4
    assert fit_for(TARGETS["host"], tables).layout.group == 4


def test_a_fit_is_said_in_a_sentence(tables: IntegerTables) -> None:
    for part, unit in ((SMALL, "cycles"), (TARGETS["cortex-m4"], "instructions")):
        fit = fit_for(part, tables)
        assert fit.cost is not None
        assert fit.words == (
            f"for {part.title or part.part}: about {fit.cost.cycles} {unit} a frame, "
            f"{fit.cost.flash} bytes of flash, {fit.cost.ram} of RAM"
        )
    assert fit_for(TARGETS["host"], tables).words == "for this machine"


def test_what_takes_too_much_flash_or_ram_is_refused_with_a_remedy(wide_tables: IntegerTables) -> None:
    assert SMALL.formula is not None
    cost = estimate(SMALL.formula, Layout(wide_tables, 1), avr=True)
    assert fit_for(SMALL, wide_tables, cost.flash).cost == cost
    told = (
        f"about {cost.flash} bytes of flash and {cost.ram} of RAM on an atmega328p, but {cost.flash - 1} and 2048 are"
    )
    with pytest.raises(FirmwareError, match=f"{told} allowed: compile with a higher ``prune``, .*or use a larger part"):
        fit_for(SMALL, wide_tables, cost.flash - 1)
    # Three quarters of the flash are allowed.
    with pytest.raises(FirmwareError, match="but 24576 and 100 are allowed"):
        fit_for(replace(SMALL, ram=100), wide_tables)


def test_no_more_flash_is_allowed_than_the_part_has(tables: IntegerTables) -> None:
    assert fit_for(SMALL, tables, 32768).target is SMALL
    with pytest.raises(FirmwareError, match=r"allowed 32769 bytes of flash: an atmega328p has 32768 bytes$"):
        fit_for(SMALL, tables, 32769)


def test_the_smallest_part_that_holds_a_build_is_found(tables: IntegerTables) -> None:
    assert smallest_fit(tables).target is SMALL
    large = make_tables(classes=20, switches=40, joints=16, bins=30, reach=20)
    assert smallest_fit(large, kind="avr").target is TARGETS["avr2560"]
    with pytest.raises(FirmwareError, match="an array of an AVR has at most 32767"):
        smallest_fit(make_tables(classes=60, switches=60, joints=20, bins=60, reach=100), kind="avr")
