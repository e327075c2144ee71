"""A point of a frontier as the options of `thenar compile`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from ..compiler.build.compile import Wired
    from ..compiler.frontier.points import Frontier, Point
    from ..compiler.recordings.graspset import GraspSet
    from ..runtime.harness.wiring import Harness


@dataclass(frozen=True, slots=True)
class Picked:
    """A frontier, and the point of it that is to be built."""

    frontier: "Frontier"
    point: "Point"

    @property
    def options(self) -> dict[str, object]:
        """The options of `compile_build` that the point settles."""
        from ..compiler.selection.ways import METHODS

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
        parameter = "keep" if METHODS[setting.way.method].parameter == "switches" else "prune"
        return {**settled, "placement": setting.way.method, parameter: number}

    def wired(self, given: "Harness | None") -> "Wired | None":
        """Return the wiring to build for: the given one where the point is wired so, else a new one of its kind."""
        from ..compiler.frontier.timing.wirings import AS_WIRED, Wiring

        setting = self.point.setting
        if not setting.wiring:
            return given
        if setting.wiring == AS_WIRED:
            if given is None:
                raise click.UsageError(
                    f"Point {self.point.number} is read as the glove was wired: name its glove.toml with --glove."
                )
            return given
        return lambda names: Wiring(setting.wiring, setting.clock_hz).harness_of(names, setting.inputs != "switches")


def picked(path: Path, number: int | None, grasp_set: "GraspSet") -> Picked:
    """Return point `number` of the frontier in `path`, or the one that it picked. Raises FrontierError, UsageError."""
    from ..compiler.frontier.points import MAX_BYTES, FrontierError, frontier_from_bytes
    from ..runtime.files import read_file

    found = frontier_from_bytes(read_file(path, MAX_BYTES, FrontierError), str(path))
    wanted = found.picked if number is None else number
    if wanted is None:
        raise click.UsageError(f"{path} has points 1 to {len(found.points)}: say with --point which to build.")
    if found.fingerprint != grasp_set.fingerprint():
        raise FrontierError(
            f"{path} was found for other recordings ({found.source}): run thenar frontier on these, or compile those"
        )
    return Picked(found, found.point(wanted))
