"""The rest between grasps: an open, empty hand, from which every grasp starts and to which it returns."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from thenar.compiler.elementary import Floats

from ..body.hand import DOF, LIMITS_DEG, RESTS_DEG
from ..errors import SceneError
from ..streams import Draw, Draws
from .batch import Batch
from .effect import Effect, EffectParameters, Place, Setting, Step

_STYLE, _POSTURE, _TRANSITION = "hand.style", "hand.posture", "hand.transition"


class Parameters(EffectParameters, frozen=True):
    """Standard deviations of rests in degrees: between subjects, in addition to that of all postures; between rests."""

    sd_deg: float = 0.0
    habit_sd_deg: float = 0.0
    each_sd_deg: float = 0.0


def _prepare(parameters: Parameters, setting: Setting) -> Step:
    assert setting.rest is not None
    usual = RESTS_DEG[setting.rest]

    def step(batch: Batch, draw: Draw) -> None:
        own = replace(draw, effect=_STYLE, draws=Draws()).per_subject(len(DOF) + 1).normal()[:-1]
        resting = draw.at_rest(batch.trials)
        mean = usual + parameters.sd_deg * own + parameters.habit_sd_deg * resting.per_type(len(DOF)).normal()

        def rest(before: Draw) -> Floats:
            varied = mean + parameters.each_sd_deg * before.per_repetition(len(DOF)).normal()
            return np.clip(varied, LIMITS_DEG[:, 0], LIMITS_DEG[:, 1])

        # The rest after a trial is the one before the next.
        batch.previous_deg, batch.rest_deg = rest(resting), rest(draw.at_rest(batch.trials + 1))

    return step


_REST = Effect(
    name="glove.rest",
    summary="opens the hand before and after each grasp",
    order=105,
    reads=("trials",),
    writes=("previous_deg", "rest_deg"),
    parameters=Parameters,
    prepare=_prepare,
)


def resting(listed: Mapping[str, EffectParameters], setting: Setting) -> Place:
    """Return the step that sets the rests of the hand, varied by the `listed` effects like other postures.

    Raises SceneError if nothing would move the hand, or no row would show it.
    """
    needs = {
        'rows = "all"': setting.every_frame,
        "a lead_ms": setting.first_us < 0,
        "a release_ms": setting.release_us > 0,
        "the effect [effects.hand.transition]": _TRANSITION in listed,
    }
    if lacking := [what for what, there in needs.items() if not there]:
        raise SceneError(f"recording.rest: for the hand to return to an open rest the scene needs {', '.join(lacking)}")
    style, posture = listed.get(_STYLE), listed.get(_POSTURE)
    spreads = Parameters(
        sd_deg=getattr(style, "sd_deg", 0.0),
        habit_sd_deg=getattr(style, "habit_sd_deg", 0.0),
        each_sd_deg=getattr(posture, "sd_deg", 0.0),
    )
    return Place(_REST, own=True, parameters=spreads)
