"""Validate the model of classify times against measurements: layouts compiled and simulated, or Python timed."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice, product
from math import ceil
from statistics import fmean
from typing import TypeVar

import numpy as np

from thenar.runtime.tables import IntegerTables

from ...firmware.choose import Fit
from ...firmware.targets import Target
from ...workers import in_workers
from ..points import Check, How
from .classify_times import ClassifyModel, fitting
from .python_times import classify_us
from .simulated import Outcome, run_layout, run_scan, scan_trials

# The least number of measured points.
LEAST = 30
# Of more tables than this, evenly spaced ones give the layouts.
_TABLES = 10
# Shares of the inputs for additional tables: halves, quarters and so on down to 64ths, from the coarsest.
_SHARES = tuple(step / 2**level for level in range(1, 7) for step in range(2**level - 1, 0, -2))

_T = TypeVar("_T")


def check(
    model: ClassifyModel, several: Sequence[IntegerTables], *, jobs: int = 1, least: int = LEAST
) -> tuple[Check, ...]:
    """Return the model's time errors over at least `least` points, evenly spread over the tables and their layouts; if
    these are too few, also over the same tables with fewer inputs. On an AVR, also the errors of scan times.

    The tables should be those of the run. There are no checks if tools are missing (`unchecked` names them), on a
    Raspberry Pi that is not this machine, or without points. Raises FirmwareError if a layout does not compile or run.
    """
    if not several or unchecked(model) is not None:
        return ()
    if model.part is None:
        return (_on_python(model, several, least),)
    outcomes = list(in_workers(run_layout, _trials(several, model.part, least), jobs))
    what = "cycles of classify()" if model.part.avr else "instructions of classify()"
    found = [_judged(f"{what} on {model.part.named}, slowest frame", "simulated", outcomes)] if outcomes else []
    if "scan" in model.part.modes:
        scans = list(in_workers(run_scan, scan_trials(model.target), jobs))
        found.append(_judged(f"time of a whole scan by the firmware of {model.part.named}", "simulated", scans))
    return tuple(found)


def unchecked(model: ClassifyModel) -> str | None:
    """Return, in a sentence, why the model cannot be validated here; None if it can."""
    if model.part is None:
        other = "classify times on pi were not validated by measurement: this machine is no Raspberry Pi"
        return other if model.guessed else None
    if lack := model.part.missing():
        return f"classify times on {model.target} were not validated in a simulator: {lack}"
    return None


def _on_python(model: ClassifyModel, several: Sequence[IntegerTables], least: int) -> Check:
    assert model.python is not None
    tables = [*several, *islice(_smaller(several), max(0, least - len(several)))]
    predicted = [model.python.us(each) for each in tables]
    found = classify_us(tables, model.python.yardstick)
    outcomes = [Outcome(*pair) for pair in zip(predicted, found, strict=True)]
    return _judged("time of a frame in runtime.scores on this machine", "measured", outcomes)


def _trials(several: Sequence[IntegerTables], part: Target, least: int) -> list[Fit]:
    """Return `least` classifiers, evenly spread over the tables, or as many as there are."""
    chosen, found = _spread(several, _TABLES), list[Fit]()
    for number, tables in enumerate(chain(chosen, _smaller(chosen))):
        if number >= len(chosen) and len(found) >= least:
            break
        fit = fitting(tables, part)
        found += [] if fit is None else [fit]
    return _spread(found, least)


def _smaller(several: Sequence[IntegerTables]) -> Iterator[IntegerTables]:
    """Yield the tables with fewer of their inputs, no shape of one table twice."""
    seen = {(number, each.n_switches, each.n_joints) for number, each in enumerate(several)}
    for share, (number, each) in product(_SHARES, enumerate(several)):
        switches, joints = ceil(share * each.n_switches), ceil(share * each.n_joints)
        if (number, switches, joints) not in seen:
            seen.add((number, switches, joints))
            yield with_fewer(each, switches, joints)


def with_fewer(tables: IntegerTables, switches: int, joints: int) -> IntegerTables:
    """Return the tables of the first switches and joints alone."""
    slopes = tuple(slope for slope in tables.slopes if slope.joint < joints)
    return replace(
        tables,
        switch_rows=tables.switch_rows[:switches],
        switch_means=tables.switch_means[:switches],
        thresholds=tables.thresholds[:joints],
        joint_rows=tables.joint_rows[:joints],
        joint_means=tables.joint_means[:joints],
        slopes=slopes,
        pairs=tuple(pair for pair in tables.pairs if max(pair.joints) < joints),
        grid=tables.grid if slopes else 1,
    )


def _spread(several: Sequence[_T], most: int) -> list[_T]:
    """Return at most `most` of these, evenly spaced, including the first and the last."""
    places = np.linspace(0, len(several) - 1, min(most, len(several))).round().astype(int)
    return [several[place] for place in places.tolist()]


def _judged(what: str, how: How, outcomes: Sequence[Outcome]) -> Check:
    errors = sorted(outcome.error for outcome in outcomes)
    return Check(what, how, len(errors), fmean(errors), errors[-1])
