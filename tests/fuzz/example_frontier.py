"""A frontier as `thenar frontier` finds it on 3 subjects x 1400 grasps, made up: valid, rich, and the same every time.

Import it as a module of its own (`conftest.py` beside it shows how); every call returns an equal frontier.
"""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import msgspec

from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.frontier.points import (
    SCHEMA,
    Frontier,
    FrontierPoint,
    PlacementChoice,
    PointSetting,
    PointTime,
    ReferencePoint,
    Tried,
    frontier_from_bytes,
    frontier_to_bytes,
)
from thenar.runtime.manifest import Of
from thenar.runtime.recipe import Inputs

GRASPS = (
    *("PoS", "PoH", "PoI", "PoE-W", "PoE-N", "Lat", "Tri"),
    *("PMT", "Par", "CirS", "CirP", "TiP", "Add", "Pla"),
)
N_SWITCHES, N_JOINTS = 160, 16
TRANSFER_US = 1736.1  # 20 bytes at 115200 baud

_PARTS = ("thumb", "index", "middle", "ring", "little", "palm")
SWITCHES = tuple(f"{_PARTS[number * 7 % 6]}-{number:03d}" for number in range(N_SWITCHES))

# inputs, switches, method, parameter, rounds, width, wiring, its clock in kHz, scan us, classify us, rate
_POINTS: tuple[tuple[Any, ...], ...] = (
    ("switches", 6, "elimination", 6, 20, 4, "mcp23017", 1000, 48.0, 61.5, 0.712),
    ("switches", 10, "elimination", 10, 40, 5, "mcp23017", 1000, 48.0, 97.9, 0.801),
    ("switches", 16, "elimination", 16, 60, 6, "mcp23017", 1000, 48.0, 150.6, 0.866),
    ("switches", 24, "id3-cost", 24, 80, 8, "tca6424a", 1000, 58.0, 231.4, 0.918),
    ("switches", 33, "elimination", 33, 100, 8, "mcp23017", 1000, 96, 344.0, 0.929),
    ("switches", 50, "id3-cost", 50, 120, 8, "mcp23017", 400, 241.0, 429.0, 0.934),
    ("joints", 0, "elimination", 0, 150, 8, "as wired", 0, 0.0, 298.2, 0.952),
    ("both", 8, "elimination", 8, 150, 8, "mcp23017", 1000, 48.0, 330.0, 0.978),
    ("both", 16, "elimination", 16, 200, 8, "as wired", 400, 118.0, 421.3, 0.988),
    ("both", 33, "elimination", 33, 300, 12, "board", 1000, 330.0, 905.7, 0.9915),
    ("both", 12, "id3-cost", 0.25, 80, 6, "pca9555", 400, 122.0, 363.0, 0.961),
)  # fmt: skip


def example_frontier(**changes: object) -> Frontier:
    """Return the frontier, some of its fields changed; it has gone through JSON, so all types hold."""
    frontier = Frontier(
        schema=SCHEMA,
        thenar="0.1.0",
        source="kamakura.grasps",
        fingerprint="5f3a9c0e" * 8,
        rows=4200,
        trials=4200,
        subjects=3,
        by="new subject",
        n_switches=N_SWITCHES,
        n_joints=N_JOINTS,
        grasps=GRASPS,
        target="avr328p",
        machine="ATmega328P at 16 MHz",
        folds=4,
        repeats=3,
        combinations=184_320,
        points=_points(),
        tried=_tried(),
        marks=_marks(),
        skipped=("qemu-system-arm is missing: no Cortex-M was measured.",),
        picked=5,
        wanted="--budget-us 500",
    )
    return frontier_from_bytes(frontier_to_bytes(msgspec.structs.replace(frontier, **changes)))


def rate(mean: float, of: Of = "new subject") -> Rate:
    """Return a rate with the interval that 4200 independent trials give, or nearly so."""
    half = 1.96 * (mean * (1 - mean) / 4200) ** 0.5
    return Rate(of, "trials", (round(4200 * mean),), 4200, 3, mean, max(0.0, mean - half), min(1.0, mean + half))


def _points() -> tuple[FrontierPoint, ...]:
    points = [_point(number, *row) for number, row in enumerate(_POINTS, 1)]
    costs: dict[str, Callable[[FrontierPoint], float]] = {
        "frame": lambda point: point.frame.us,
        "switches": lambda point: len(point.switches),
    }
    return tuple(
        msgspec.structs.replace(
            point, fronts=tuple(name for name, cost in costs.items() if not _beaten(point, points, cost))
        )
        for point in points
    )


def _beaten(point: FrontierPoint, points: Sequence[FrontierPoint], cost: Callable[[FrontierPoint], float]) -> bool:
    mine = (cost(point), -point.rate.mean)
    return any(
        cost(other) <= mine[0] and -other.rate.mean <= mine[1] and (cost(other), -other.rate.mean) != mine
        for other in points
    )


def _point(
    number: int,
    inputs: Inputs,
    kept: int,
    method: str,
    parameter: float,
    rounds: int,
    width: int,
    wiring: str,
    clock_khz: int,
    scan_us: float,
    classify_us: float,
    mean: float,
) -> FrontierPoint:
    transfer_us = 0.0 if inputs == "switches" else TRANSFER_US
    setting = PointSetting(PlacementChoice(method, parameter), inputs, rounds, width, wiring, 1000 * clock_khz)
    return FrontierPoint(
        number=number,
        setting=setting,
        switches=tuple(SWITCHES[(41 * place + 3) % N_SWITCHES] for place in range(kept)),
        rate=rate(mean),
        luck=0.004,
        frames=None,
        other_rate=rate(mean + (1 - mean) / 4, "pooled"),
        scan=PointTime(scan_us, "wire"),
        transfer=PointTime(transfer_us, "wire"),
        classify=PointTime(classify_us, "simulated" if number % 3 == 1 else "model"),
        frame=PointTime(max(scan_us, transfer_us) + classify_us, "simulated" if number % 3 == 1 else "model"),
        flash=1900 + 14 * (rounds + 12 * kept) + (2600 if inputs != "switches" else 0),
        ram=48 + 2 * kept,
        ports=-(-kept // 8),
        chips=-(-kept // 16),
    )


def _tried() -> tuple[Tried, ...]:
    kept: list[tuple[Inputs, int, float, float]] = [
        *(("switches", size, 0.70 + 0.236 * (1 - 0.94 ** (size - 5)), 105 + 9.5 * size) for size in _sizes(6)),
        *(("both", size, 0.955 + 0.036 * (1 - 0.93**size), 2030 + 16 * size) for size in _sizes(4)),
    ]
    methods = (("elimination", 0.998, 1.02, 120), ("id3", 0.985, 1.16, 100), ("cmim", 0.994, 1.1, 150))
    return tuple(
        Tried(PlacementChoice(method, float(size)), inputs, size, rounds, rate(mean * worse), us * slower)
        for (inputs, size, mean, us), (method, worse, slower, rounds) in product(kept, methods)
    )


def _sizes(first: int) -> tuple[int, ...]:
    return tuple(round(first * 1.7**step) for step in range(7))


def _marks() -> tuple[ReferencePoint, ...]:
    return (
        ReferencePoint("all 160 switches", 160, rate(0.936), 2050.0),
        ReferencePoint("paper, S = 13", 66, rate(0.932), 1420.0),
        ReferencePoint("paper, S = 62", 35, rate(0.915), 905.0),
        ReferencePoint("your build", 49, rate(0.927), 1105.0),
    )
