"""The glove's own steps: the hand recalls a posture, switches close, frames are scanned and read.

Every scene has `STEPS`, one with taxels `TAXEL_STEPS`, one with rests between grasps `rest_step`. Effects act before
and after them, by their order numbers.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.compiler.recordings.graspset import Joint

from ..body.cyberglove import SubjectCalibration, sensors_deg
from ..body.hand import DOF, LIMITS_DEG, RESTS_DEG
from ..errors import SceneError
from ..streams import Draw
from .batch import Batch
from .effect import Effect, SceneSetting, Step, frame_times
from .ramp import NEVER

Act = Callable[[Batch, SceneSetting], None]
STEPS: tuple[Effect, ...] = ()


def _own(order: int, summary: str, reads: tuple[str, ...], writes: tuple[str, ...]) -> Callable[[Act], Act]:
    """Add the decorated function to `STEPS`; _recall is "glove.recall". It draws no random numbers."""

    def add(act: Act) -> Act:
        def prepare(setting: SceneSetting) -> Step:
            def step(batch: Batch, _draw: Draw) -> None:
                act(batch, setting)

            return step

        global STEPS
        name = f"glove{act.__name__.replace('_', '.', 1)}"
        STEPS += (Effect(name, summary, order, reads, writes, prepare=prepare),)
        return act

    return add


@_own(100, "takes the planned posture, the object's pose and the grip", (), ("posture_deg", "pose", "grip_n"))
def _recall(batch: Batch, setting: SceneSetting) -> None:
    grasp = batch.condition.held
    batch.posture_deg = np.tile(grasp.posture_deg, (len(batch), 1))
    batch.pose = np.tile(grasp.pose, (len(batch), 1))
    batch.grip_n = np.full(len(batch), grasp.grip_n)


@_own(300, "sets the closing force of every switch", ("forces_n",), ("thresholds_n",))
def _threshold(batch: Batch, setting: SceneSetting) -> None:
    batch.thresholds_n = np.full(batch.forces_n.shape[1], setting.threshold_n)


@_own(320, "closes the switches that are pressed hard enough", ("forces_n", "thresholds_n"), ("on_us", "off_us"))
def _close(batch: Batch, setting: SceneSetting) -> None:
    let_go_us = NEVER if setting.let_go_us is None else setting.let_go_us
    closed = batch.forces_n > batch.thresholds_n
    batch.on_us = np.where(closed, 0, NEVER)
    batch.off_us = np.where(closed, let_go_us, NEVER)


@_own(400, "sets the times of frames", (), ("frame_us",))
def _frames(batch: Batch, setting: SceneSetting) -> None:
    batch.frame_us = np.tile(frame_times(setting), (len(batch), 1))


@_own(500, "bends the CyberGlove's sensors with the hand", ("posture_deg", "frame_us"), ("sensors_deg",))
def _sense(batch: Batch, setting: SceneSetting) -> None:
    felt = sensors_deg(batch.posture_deg)
    batch.sensors_deg = np.repeat(felt[:, None], batch.frame_us.shape[1], axis=1)


@_own(540, "converts the sensors to bytes by the subject's calibration", ("sensors_deg",), ("raw",))
def _encode(batch: Batch, setting: SceneSetting) -> None:
    batch.raw = SubjectCalibration.of_subject(setting.seed, batch.condition.subject).bytes(batch.sensors_deg)


@_own(700, "reads every switch in every frame", ("on_us", "off_us", "frame_us", "delay_us"), ("bits",))
def _sample(batch: Batch, setting: SceneSetting) -> None:
    at = batch.frame_us[:, :, None] if batch.delay_us is None else batch.frame_us[:, :, None] + batch.delay_us
    batch.bits = (batch.on_us[:, None] <= at) & (at < batch.off_us[:, None])


TAXEL_ADC = "taxel.adc"


@dataclass(frozen=True, slots=True)
class TaxelConverter:
    """The converter of taxels (`TAXEL_ADC`): counts of `bits` bits in even steps up to the full scale of `full_n`.

    By default a count is a thousandth of a newton.
    """

    bits: int = 15
    full_n: float = 32.768

    def codes(self, newtons: Floats) -> NDArray[np.uint16]:
        """Return the counts of forces of any shape, clipped to the first and the last."""
        steps = 1 << self.bits
        return np.clip(np.rint(newtons * (steps / self.full_n)), 0.0, steps - 1.0).astype(np.uint16)

    def column(self, name: str) -> Joint:
        """Return the joint that describes the counts of a taxel of this name."""
        return Joint(name, "N", 0, 0.0, 1 << (self.bits - 1), self.full_n / 2.0)


def _feel(setting: SceneSetting) -> Step:
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


def _count(setting: SceneSetting) -> Step:
    ideal = TaxelConverter()

    def step(batch: Batch, draw: Draw) -> None:
        batch.taxels = ideal.codes(batch.taxels_n)

    return step


# Additional steps for a glove with taxels, with any effects.
TAXEL_STEPS = (
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


_STYLE, _POSTURE, _TRANSITION = "hand.style", "hand.posture", "hand.transition"


def _prepare_rest(setting: SceneSetting, *, sd_deg: float, habit_sd_deg: float, rest_sd_deg: float) -> Step:
    """Return the step for these standard deviations of rests in degrees: between subjects, of all postures and in
    addition of rests; between the rests of one.
    """
    assert setting.rest is not None
    usual = RESTS_DEG[setting.rest]

    def step(batch: Batch, draw: Draw) -> None:
        style = replace(draw, effect=_STYLE, draws=Counter()).per_subject(len(DOF) + 1).normal()[:-1]
        resting = draw.at_rest(batch.trials)
        mean = usual + sd_deg * style + habit_sd_deg * resting.per_type(len(DOF)).normal()

        def rest(before: Draw) -> Floats:
            varied = mean + rest_sd_deg * before.per_repetition(len(DOF)).normal()
            return np.clip(varied, LIMITS_DEG[:, 0], LIMITS_DEG[:, 1])

        # The rest after a trial is the one before the next.
        batch.previous_deg, batch.rest_deg = rest(resting), rest(draw.at_rest(batch.trials + 1))

    return step


def rest_step(listed: Mapping[str, Mapping[str, Any]], setting: SceneSetting) -> Effect:
    """Return the step that sets the rests of the hand, varied by the `listed` effects like other postures.

    Raises SceneError if nothing would move the hand, or no row would show it.
    """
    needs = {
        'rows = "all"': setting.every_frame,
        "a lead_ms": setting.first_us < 0,
        "a release_ms": setting.release_us > 0,
        "the effect [effects.hand.transition]": _TRANSITION in listed,
    }
    if lacking := [what for what, given in needs.items() if not given]:
        raise SceneError(f"recording.rest: for the hand to return to an open rest the scene needs {', '.join(lacking)}")
    style, posture = listed.get(_STYLE, {}), listed.get(_POSTURE, {})
    spreads = {
        "sd_deg": style.get("sd_deg", 0.0),
        "habit_sd_deg": style.get("habit_sd_deg", 0.0),
        "rest_sd_deg": posture.get("sd_deg", 0.0),
    }
    return Effect(
        name="glove.rest",
        summary="opens the hand before and after each grasp",
        order=105,
        reads=("trials",),
        writes=("previous_deg", "rest_deg"),
        prepare=partial(_prepare_rest, **spreads),
    )
