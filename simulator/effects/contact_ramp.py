"""The grip grows gradually, and each switch closes when the force on it passes its threshold.

The contact model is solved at evenly spaced levels of grip; forces are interpolated linearly, from 0 at the first
touch. The release runs in reverse.
A switch that is pressed only temporarily closes and opens once.
"""

from collections.abc import Sequence
from itertools import islice
from typing import Annotated

import numpy as np
from msgspec import Meta

from ..contact.model import Contact, ContactModel, Load
from ..errors import SceneError
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Together
from ..pipeline.ramp import NEVER, Ramp, crossings
from ..streams import Draw


def prepare(
    setting: SceneSetting,
    contact: ContactModel,
    *,
    rise_ms: Annotated[float, Meta(gt=0.0, le=10_000.0)] = 200.0,
    levels: Annotated[int, Meta(ge=1, le=100)] = 10,
) -> Together:
    """Return the step that times every switch. Raises SceneError if the grip is not full when the row is read.

    The duration of the growth in milliseconds, and the number of solved levels.

    The default time is ours, of the order of the load phase of lifts (Johansson and Westling 1984, Exp. Brain Res. 56).
    """
    rise_us = 1e3 * rise_ms
    if rise_us > setting.hold_us:
        raise SceneError(
            f"effects.contact.ramp: the grip still grows when the row is read: rise_ms = {rise_ms:g} is"
            f" longer than recording.hold_ms = {setting.hold_us / 1e3:g}"
        )
    below = levels - 1

    def act(batches: Sequence[Batch], draws: Sequence[Draw]) -> None:
        found = iter(contact([load for batch in batches for load in _loads(batch, levels)]))
        for batch, draw in zip(batches, draws, strict=True):
            grown = list(islice(found, below))
            draw.count("grips solved", len(batch) * below)
            draw.count("solver steps", sum(one.steps for one in grown))
            _time(batch, grown, rise_us)

    return act


def _loads(batch: Batch, levels: int) -> list[Load]:
    """Return the loads of a batch at every level of grip below the full one."""
    commanded = (batch.condition, batch.commanded_deg, batch.commanded_pose)
    return [Load(*commanded, batch.grip_n * (level / levels)) for level in range(1, levels)]


def _time(batch: Batch, grown: Sequence[Contact], rise_us: float) -> None:
    """Set the times at which the switches of a batch close and open, and the growth of forces, from the contacts at the
    levels below the full grip.

    A repetition that does not settle at one level counts as not settled, with the residuals there.
    """
    forces = np.array([np.zeros_like(batch.forces_n), *(one.forces_n for one in grown), batch.forces_n])
    batch.ramp = Ramp(forces, rise_us)
    up_us, down_us = crossings(forces, batch.thresholds_n, rise_us / (len(grown) + 1))
    lets_go = (batch.off_us != NEVER) & (up_us != NEVER) & (down_us == NEVER)
    # In reverse from the release, the force that first closed a switch is the last to keep it closed.
    batch.off_us = np.where(lets_go, batch.off_us + np.where(lets_go, round(rise_us) - up_us, 0), down_us)
    batch.on_us = up_us
    for one in grown:
        batch.settled = batch.settled & one.settled
        batch.residual_n = np.where(one.settled, batch.residual_n, np.maximum(batch.residual_n, one.residual_n))
        batch.residual_nmm = np.where(one.settled, batch.residual_nmm, np.maximum(batch.residual_nmm, one.residual_nmm))


MEMBER = Effect(
    name="contact.ramp",
    summary="the grip grows, and switches close one by one",
    order=330,
    reads=(
        *("commanded_deg", "commanded_pose", "grip_n", "forces_n", "thresholds_n"),
        *("settled", "residual_n", "residual_nmm", "on_us", "off_us"),
    ),
    writes=("on_us", "off_us", "settled", "residual_n", "residual_nmm", "ramp"),
    timed=True,
    together=prepare,
)
