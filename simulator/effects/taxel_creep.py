"""The reading of a pressed pad grows over time, and does not fall at once on release.

Resistance under a constant load falls with the logarithm of time; for Interlink's FSR 400 series (data sheet
PDS-10004-C) by less than 5 % a decade, which is published. Three relaxations (Kelvin-Voigt), a decade apart, follow
that law from a few hundredths of a second to ten seconds; their number is ours. Nothing remains of the previous grasp.
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import Floats, exp

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw

_TIMES_US = np.array([0.1e6, 1e6, 10e6])


def prepare(setting: SceneSetting, *, per_decade: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.05) -> Step:
    """Return the step that adds the creep since contact to each reading.

    Growth of a reading, as a share of the force, per tenfold time under load.
    """

    def step(batch: Batch, draw: Draw) -> None:
        crept: list[Floats] = []
        states = np.zeros((len(_TIMES_US), len(batch), batch.taxels_n.shape[2]))
        # A frame's force has been present since the previous frame, at the earliest since contact.
        before = np.zeros(len(batch))
        for frame in range(batch.taxels_n.shape[1]):
            at, force = np.maximum(batch.frame_us[:, frame], 0).astype(np.float64), batch.taxels_n[:, frame]
            kept = exp(-(at - before) / _TIMES_US[:, None])
            states = force + (states - force) * kept[:, :, None]
            crept.append(states[0] + states[1] + states[2])
            before = at
        batch.taxels_n = batch.taxels_n + per_decade * np.stack(crept, axis=1)

    return step


MEMBER = Effect(
    name="taxel.creep",
    summary="readings creep up under a load that stays",
    order=580,
    reads=("frame_us", "taxels_n"),
    writes=("taxels_n",),
    prepare=prepare,
)
