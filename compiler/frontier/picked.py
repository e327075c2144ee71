"""A frontier's point that is to be built: its options and its wiring."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from thenar.drivers.i2c.chips import CHIPS, expanders
from thenar.drivers.spi.chips import SPI_CHIPS
from thenar.runtime.files import read_file
from thenar.runtime.harness.wiring import SLOWEST_HZ, Harness
from thenar.runtime.names import shortened, taxel_and_code

from ..glove.propose import CONVERTER
from ..placement.methods.base import METHODS
from ..recordings.graspset import GraspSet
from ..trainers.base import TRAINERS
from .points import MAX_BYTES, Frontier, FrontierError, FrontierPoint, frontier_from_bytes
from .wirings import AS_WIRED, BOARD, WiringOption


@dataclass(frozen=True, slots=True)
class Picked:
    """A frontier, the selected point, and the names of the set's joints; see `picked`."""

    frontier: Frontier
    point: FrontierPoint
    joints: tuple[str, ...]

    @property
    def options(self) -> dict[str, object]:
        """The options of `compile_build` that the point determines."""
        setting = self.point.setting
        names = ("max_bins", "keep_joints", "levels", "rounds")
        chosen = {name: value for name in names if (value := getattr(setting, name)) is not None}
        if self.point.by_sensors:
            chosen |= {"sensors": self.point.size, "inputs": "both"}
            chosen |= {name: getattr(self.frontier, name) for name in ("have", "never", "price", "prices")}
        elif setting.inputs != "joints":
            parameter = "keep" if METHODS[setting.placement.method].by_number else "prune"
            chosen |= {"placement": setting.placement.method, parameter: int(setting.placement.parameter)}
        return {
            "inputs": setting.inputs,
            "width": setting.width,
            "table_bits": setting.table_bits,
            "trainer": setting.trainer,
            # Settings that are not written are defaults, and none is left to choose.
            **{option.name: option.default for option in TRAINERS[setting.trainer].settings},
            **setting.settings,
            **chosen,
        }

    def wired(self, harness: Harness | None) -> Harness | Callable[[Sequence[str]], Harness] | None:
        """Return the wiring for `compile_build`: this harness if the point is wired so, else a function that makes a
        new one of its kind for the kept switches.

        Raises FrontierError if the point needs the wiring of a glove that is not given.
        """
        setting = self.point.setting
        if not setting.wiring:
            return harness
        if setting.wiring == AS_WIRED and harness is None:
            raise FrontierError(
                f"point {self.point.number} is read as the glove was wired: name its glove.toml with ``glove``"
            )

        def harness_of(kept: Sequence[str]) -> Harness:
            if set(kept) != set(self.point.switches):
                raise FrontierError(
                    f"point {self.point.number} lists {len(self.point.switches)} switches, but its placement keeps "
                    f"{len(kept)}, not the same ones: run thenar frontier again"
                )
            if harness is not None and setting.wiring == AS_WIRED:
                return harness
            joints = () if setting.inputs == "switches" else self.point.joints or self.joints
            return WiringOption(setting.wiring, setting.clock_hz).harness_of(kept, joints)

        return harness_of


def picked(path: Path, number: int | None, grasp_set: GraspSet) -> Picked:
    """Return a point of a frontier after checking that it can be built from these recordings.

    Parameters
    ----------
    path : Path
        A frontier.json.
    number : int or None
        The point's number; None for the one that the frontier picked.
    grasp_set : GraspSet
        The recordings that the frontier was found for.

    Raises
    ------
    FrontierError
        If the file is no frontier's, is of other recordings, or has no such point, or if the point cannot be built.

    Examples
    --------
    >>> chosen = picked(Path("frontier/frontier.json"), 7, grasp_set)  # doctest: +SKIP
    >>> compile_build(
    ...     grasp_set, Path("build"), **chosen.options, harness=chosen.wired(None)
    ... )  # doctest: +SKIP
    """
    frontier = frontier_from_bytes(read_file(path, MAX_BYTES, FrontierError), str(path))
    number = frontier.picked if number is None else number
    if number is None:
        raise FrontierError(f"{path} has points 1 to {len(frontier.points)}: say with ``point`` which to build")
    if frontier.fingerprint != grasp_set.fingerprint():
        raise FrontierError(
            f"{path} was found for other recordings ({frontier.source}): run thenar frontier on these, or compile those"
        )
    point = frontier.point(number)
    _check(point, grasp_set, f"{path}: point {point.number}")
    return Picked(frontier, point, tuple(joint.name for joint in grasp_set.joints))


def _check(point: FrontierPoint, grasp_set: GraspSet, what: str) -> None:
    """Raise FrontierError if a point cannot be built here: before the training, not after it."""
    setting = point.setting
    levels = [taxel_and_code(name) or (name, 0) for name in point.switches]
    if not set(grasp_set.element_names).issuperset(name for name, _ in levels):
        raise FrontierError(f"{what} keeps switches that the recordings do not have: run thenar frontier on these")
    choosing = not point.by_sensors and setting.inputs != "joints"
    if choosing and setting.placement.method not in METHODS:
        raise FrontierError(f"{what} has an unknown method: {shortened(repr(setting.placement.method))}")
    least = 1 if point.by_sensors or (choosing and METHODS[setting.placement.method].by_number) else 0
    if not (setting.placement.parameter.is_integer() and setting.placement.parameter >= least):
        raise FrontierError(
            f"{what} has {setting.placement.parameter} as its method's parameter: it must be an integer from {least} on"
        )
    if setting.trainer not in TRAINERS:
        raise FrontierError(f"{what} has an unknown trainer: {shortened(repr(setting.trainer))}")
    if TRAINERS[setting.trainer].staged != (setting.rounds is not None):
        raise FrontierError(f"{what} gives rounds to a trainer without rounds, or none to one with rounds")
    clocks = {name: chip.clock_hz for name, chip in (*expanders().items(), (CONVERTER, CHIPS[CONVERTER]))}
    clocks |= {name: chip.clock_hz for name, chip in SPI_CHIPS.items()}
    if setting.wiring not in ("", AS_WIRED, BOARD, *clocks):
        raise FrontierError(f"{what} has an unknown wiring: {shortened(repr(setting.wiring))}")
    if setting.wiring in clocks and not SLOWEST_HZ <= setting.clock_hz <= clocks[setting.wiring]:
        raise FrontierError(f"{what} runs its {setting.wiring} at {setting.clock_hz} Hz, which it cannot")
    if setting.wiring not in ("", AS_WIRED) and not WiringOption(setting.wiring, setting.clock_hz).fits(point.switches):
        raise FrontierError(f"{what} has no room for its {len(point.switches)} switches on {setting.wiring}")
