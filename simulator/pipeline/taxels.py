"""Taxels: places of the glove that measure force, and their conversion to counts."""

from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.compiler.recordings.graspset import Joint

from ..body.layout import murakami160
from ..streams import Draw
from .batch import Batch
from .effect import Effect, EffectParameters, Setting, Step

Codes = NDArray[np.uint16]


class Converter(EffectParameters, frozen=True):
    """Counts of `bits` bits in even steps up to the full scale of `full_n` newtons; by default a thousandth of a newton
    per count.
    """

    bits: Annotated[int, msgspec.Meta(ge=1, le=15)] = 15
    full_n: Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)] = 32.768

    def codes(self, newtons: Floats) -> Codes:
        """Return the counts of forces of any shape, clipped to the first and the last."""
        steps = 1 << self.bits
        return np.clip(np.rint(newtons * (steps / self.full_n)), 0.0, steps - 1.0).astype(np.uint16)

    def column(self, name: str) -> Joint:
        """Return the joint that describes the counts of a taxel of this name."""
        return Joint(name, "N", 0, 0.0, 1 << (self.bits - 1), self.full_n / 2.0)


IDEAL = Converter()


def _feel(parameters: EffectParameters, setting: Setting) -> Step:
    places = list(setting.taxels)

    def step(batch: Batch, draw: Draw) -> None:
        at = batch.frame_us[:, :, None]
        if batch.delay_us is not None:
            at = at + np.broadcast_to(batch.delay_us, (*batch.frame_us.shape, batch.forces_n.shape[1]))[:, :, places]
        forces = batch.forces_n[:, places]
        if batch.ramp is None:
            pressed = (at >= 0) if setting.let_go_us is None else (at >= 0) & (at < setting.let_go_us)
            batch.taxels_n = np.where(pressed, forces[:, None], 0.0)
        else:
            batch.taxels_n = batch.ramp.forces_at(at, places, setting.let_go_us)

    return step


def _count(parameters: EffectParameters, setting: Setting) -> Step:
    def step(batch: Batch, draw: Draw) -> None:
        batch.taxels = IDEAL.codes(batch.taxels_n)

    return step


# Additional steps for a glove with taxels, with any effects.
STEPS = (
    Effect(
        name="glove.feel",
        summary="presses every taxel with the force on its place, frame by frame",
        order=550,
        reads=("forces_n", "frame_us", "delay_us", "ramp"),
        writes=("taxels_n",),
        prepare=_feel,
    ),
    Effect(
        name="glove.count",
        summary="converts the taxels' newtons to counts",
        order=710,
        reads=("taxels_n",),
        writes=("taxels",),
        prepare=_count,
    ),
)


def taxel_places(listed: tuple[str, ...] | str) -> tuple[int, ...]:
    """Return the numbers of the places with taxels: "all", or names of places or of segments, as "index_distal".

    Raises ValueError for the first that the layout does not have.
    """
    names = [patch.name for patch in murakami160()]
    if listed == "all":
        return tuple(range(len(names)))
    found = set[int]()
    for given in listed:
        own = {place for place, name in enumerate(names) if given in (name, name.rpartition("_")[0])}
        if not own:
            raise ValueError(
                f"the glove has no place {given!r}: `thenar draw --numbers` shows all, thumb_distal_1 is one"
            )
        found |= own
    return tuple(sorted(found))
