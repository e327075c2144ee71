"""`verify_firmware`: do compiled classifiers answer as Python does, in every score of every frame that is tried?"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

from msgspec import Struct

from thenar.runtime.build import Build
from thenar.runtime.tables import IntegerTables

from ..firmware.choose import choose
from ..firmware.errors import FirmwareError
from ..firmware.library import Fit, smallest_fit
from ..firmware.probes import Probes, extreme_frames, random_frames
from ..firmware.running import toolchain_missing
from ..firmware.targets import TARGETS
from ..recordings.graspset import GraspSet
from .carried import Carried, carried_firmware
from .firmware_trial import ANSWERS, FirmwareTrial, TargetCheck
from .select import select_inputs

Kind = Literal["host", "avr", "cortex-m"]
KINDS: tuple[Kind, ...] = ("host", "avr", "cortex-m")
RANDOM_FRAMES = 10_000
_SEED = 1
_CORES = ("cortex-m0plus", "cortex-m4")


class FirmwareVerification(Struct, frozen=True, kw_only=True):
    """What verification of firmware found: every check on the same rows, extreme and random frames; and what the
    build's own `firmware/` is worth.
    """

    rows: int
    extreme: int
    random: int
    checks: tuple[TargetCheck, ...]
    carried: Carried

    @property
    def holds(self) -> bool:
        """Whether every score, grasp type and name is the same everywhere, and the build carries no other firmware."""
        return not self.carried.outdated and not any(check.differing or check.misnamed for check in self.checks)


def verify_firmware(
    folder: str | Path,
    grasp_set: GraspSet,
    kinds: Sequence[Kind],
    progress: Callable[[int, int], None] | None = None,
) -> FirmwareVerification:
    """Hold the classifiers that gcc makes for `kinds` against Python: every row, extreme frames, 10,000 random ones.

    "host" runs with the address and undefined behaviour sanitizers, "avr" is the smallest AVR that the classifier fits,
    "cortex-m" both cores. Each is run from nothing for every frame, and once more from the changes between frames, on
    "host" and "cortex-m" with every switch set by set_switch() and every name asked for. Of a
    build that no AVR holds, host runs the layout of the larger core. Raises FirmwareError where a tool is missing or a
    part cannot hold the build, else as `verify_build` does.
    """
    build = Build.load(folder)
    fits = [fit for kind in KINDS if kind in kinds for fit in _fits(build.tables, kind)]
    for fit in fits:
        if lack := toolchain_missing(fit.target):
            raise FirmwareError(f"firmware for {fit.target.part} cannot be tried here: {lack}")
    bits, codes = select_inputs(grasp_set, build.manifest)
    extreme, random = extreme_frames(build.tables), random_frames(build.tables, RANDOM_FRAMES, _SEED)
    trial = FirmwareTrial(build, Probes(bits, codes), extreme, random)
    runs = [(fit, answer) for fit in fits for answer in ANSWERS]
    checks: list[TargetCheck] = []
    for fit, answer in runs:
        if progress is not None:
            progress(len(checks), len(runs))
        checks.append(trial.check(fit, answer))
    return FirmwareVerification(
        rows=len(bits),
        extreme=len(extreme),
        random=len(random),
        checks=tuple(checks),
        carried=carried_firmware(Path(folder), build),
    )


def _fits(tables: IntegerTables, kind: Kind) -> list[Fit]:
    """Return the parts to try, each with its layout. Of a build that no AVR holds, host takes a larger part's."""
    match kind:
        case "host":
            return [Fit(TARGETS["host"], smallest_fit(tables).choice)]
        case "avr":
            return [smallest_fit(tables, avr=True)]
        case "cortex-m":
            return [Fit(TARGETS[core], choose(tables, TARGETS[core])) for core in _CORES]
