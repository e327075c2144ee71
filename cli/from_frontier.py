"""A point of a frontier as the options of `thenar compile`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thenar.compiler.artifact.compile import Wired
    from thenar.compiler.frontier.points import Frontier, Point
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.harness.wiring import Harness


@dataclass(frozen=True, slots=True)
class Picked:
    """A frontier, and the point of it that is to be built."""

    frontier: "Frontier"
    point: "Point"

    @property
    def options(self) -> dict[str, object]:
        """The options of `compile_build` that the point settles."""
        from thenar.compiler.placement.methods.base import METHODS

        setting = self.point.setting
        settled: dict[str, object] = {
            "inputs": setting.inputs,
            "rounds": setting.rounds,
            "width": setting.width,
            "table_bits": setting.table_bits,
            "max_bins": setting.max_bins,
        }
        if setting.inputs == "joints":
            return settled
        number = int(setting.way.parameter)
        parameter = "keep" if METHODS[setting.way.method].by_number else "prune"
        return {**settled, "placement": setting.way.method, parameter: number}

    def wired(self, given: "Harness | None") -> "Wired | None":
        """Return the wiring to build for: the given one where the point is wired so, else a new one of its kind."""
        from thenar.compiler.frontier.timing.wirings import AS_WIRED, Wiring

        setting = self.point.setting
        if not setting.wiring:
            return given
        if setting.wiring == AS_WIRED and given is None:
            raise click.UsageError(
                f"Point {self.point.number} is read as the glove was wired: name its glove.toml with --glove."
            )

        def harness_of(kept: "Sequence[str]") -> "Harness":
            self._check_kept(kept)
            if given is not None and setting.wiring == AS_WIRED:
                return given
            return Wiring(setting.wiring, setting.clock_hz).harness_of(kept, setting.inputs != "switches")

        return harness_of

    def _check_kept(self, kept: "Sequence[str]") -> None:
        """Raise FrontierError unless the placement kept the switches that the point lists."""
        from thenar.compiler.frontier.points import FrontierError

        if set(kept) != set(self.point.switches):
            raise FrontierError(
                f"point {self.point.number} lists {len(self.point.switches)} switches, but its placement keeps "
                f"{len(kept)}, not the same ones: run thenar frontier again"
            )


def picked(path: Path, number: int | None, grasp_set: "GraspSet") -> Picked:
    """Return point `number` of the frontier in `path`, or the one that it picked. Raises FrontierError, UsageError."""
    from thenar.compiler.frontier.points import MAX_BYTES, FrontierError, frontier_from_bytes
    from thenar.runtime.files import read_file

    found = frontier_from_bytes(read_file(path, MAX_BYTES, FrontierError), str(path))
    wanted = found.picked if number is None else number
    if wanted is None:
        raise click.UsageError(f"{path} has points 1 to {len(found.points)}: say with --point which to build.")
    if found.fingerprint != grasp_set.fingerprint():
        raise FrontierError(
            f"{path} was found for other recordings ({found.source}): run thenar frontier on these, or compile those"
        )
    point = found.point(wanted)
    _check_point(point, grasp_set, path)
    return Picked(found, point)


def _check_point(point: "Point", grasp_set: "GraspSet", path: Path) -> None:
    """Raise FrontierError where a point cannot be built here: before the training, not after it."""
    from thenar.compiler.frontier.points import FrontierError
    from thenar.compiler.frontier.timing.wirings import AS_WIRED, BOARD, Wiring
    from thenar.compiler.placement.methods.base import METHODS
    from thenar.drivers.i2c.chips import CHIPS
    from thenar.runtime.harness.wiring import SLOWEST_HZ
    from thenar.runtime.names import shortened

    setting, there = point.setting, set(grasp_set.switch_names)
    what = f"{path}: point {point.number}"
    if not there.issuperset(point.switches):
        raise FrontierError(f"{what} keeps switches that the recordings do not have: run thenar frontier on these")
    if setting.inputs != "joints" and setting.way.method not in METHODS:
        raise FrontierError(f"{what} takes a method that is not there: {shortened(repr(setting.way.method))}")
    least = 1 if setting.inputs != "joints" and METHODS[setting.way.method].by_number else 0
    if not (setting.way.parameter.is_integer() and setting.way.parameter >= least):
        raise FrontierError(
            f"{what} takes {setting.way.parameter} for its method: it is a whole number from {least} on"
        )
    if setting.wiring not in ("", AS_WIRED, BOARD, *CHIPS):
        raise FrontierError(f"{what} takes a wiring that is not there: {shortened(repr(setting.wiring))}")
    if setting.wiring in CHIPS and not SLOWEST_HZ <= setting.clock_hz <= CHIPS[setting.wiring].clock_hz:
        raise FrontierError(f"{what} runs its {setting.wiring} at {setting.clock_hz} Hz, which it cannot")
    if setting.wiring not in ("", AS_WIRED) and not Wiring(setting.wiring, setting.clock_hz).fits(point.switches):
        raise FrontierError(f"{what} has no room for its {len(point.switches)} switches on {setting.wiring}")
