"""The sensors of a glove as they are bought: switches, pads with any number of levels, and the sensors of joints."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

from thenar.runtime.manifest import Manifest

from .text import counted, listed


@dataclass(frozen=True, slots=True)
class SensorCount:
    """How many sensors of each kind are kept, and how many there are to choose from.

    switches, pads, joints  (kept, all)
    levels                  thresholds of the kept pads: a placement may choose several of one pad
    """

    switches: tuple[int, int] = (0, 0)
    pads: tuple[int, int] = (0, 0)
    joints: tuple[int, int] = (0, 0)
    levels: int = 0

    @classmethod
    def of_build(cls, manifest: Manifest) -> Self:
        """Return the sensors that a build keeps."""
        levels = [switch.source for switch in manifest.switches if switch.threshold is not None]
        source = manifest.source
        return cls(
            switches=(len(manifest.switches) - len(levels), source.switches),
            pads=(len(set(levels)), source.taxels),
            joints=(len(manifest.joints), source.joints),
            levels=len(levels),
        )

    def __str__(self) -> str:
        """Return "3 of 8 switches, 6 of 24 pads (14 levels) and 5 of 5 joints", without kinds that the set lacks."""
        return listed(list(self._kinds()))

    def _kinds(self) -> Iterator[str]:
        levels = f" ({counted(self.levels, 'level')})" if self.levels else ""
        for (kept, every), one, many, more in (
            (self.switches, "switch", "switches", ""),
            (self.pads, "pad", "pads", levels),
            (self.joints, "joint", "joints", ""),
        ):
            if every:
                yield f"{kept} of {counted(every, one, many)}{more}"
