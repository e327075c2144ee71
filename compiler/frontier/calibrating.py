"""What has to be measured on this machine before anything can be priced; kept in the store, so that a run can go on."""

import platform
from dataclasses import dataclass

from msgspec import Struct

from .equipment import Equipment
from .storing.asking import Desk
from .timing.beside_wire import Beside, beside_wire
from .timing.classify_times import ClassifyModel
from .timing.python_times import PythonCost
from .timing.wirings import Wiring


class CalibrationKey(Struct, frozen=True):
    """For which target, and on which machine."""

    target: str
    machine: str


class Calibration(Struct, frozen=True):
    """What classifying takes in Python here, where that is asked; what a transaction takes besides the wire."""

    python: PythonCost | None
    beside: Beside


@dataclass(frozen=True, slots=True)
class CalibrationTask:
    """Measure this machine."""

    key: CalibrationKey
    cost: float = 3.0


def calibrate(task: CalibrationTask) -> Calibration:
    """Return what `task` asks for."""
    return Calibration(ClassifyModel(task.key.target).python, beside_wire(task.key.target))


def equipment_for(target: str, wirings: tuple[Wiring, ...], desk: Desk) -> Equipment:
    """Return what may be built for `target`, measured here once."""
    task = CalibrationTask(CalibrationKey(target, platform.node()))
    found = desk.here().ask("calibration", [task], calibrate, Calibration)[task.key]
    return Equipment(ClassifyModel(target, python=found.python), wirings, found.beside)
