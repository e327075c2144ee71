"""The steps of every scene: the hand recalls a posture, switches close, frames are scanned and read.

Effects act before and after them, by their order numbers.
"""

from collections.abc import Callable

import numpy as np

from ..body.cyberglove import Calibration, sensors_deg
from ..streams import Draw
from .batch import Batch
from .effect import Effect, EffectParameters, Setting, Step, frame_times
from .ramp import NEVER

Act = Callable[[Batch, Setting], None]
STEPS: tuple[Effect, ...] = ()


def _own(order: int, summary: str, reads: tuple[str, ...], writes: tuple[str, ...]) -> Callable[[Act], Act]:
    """Add the decorated function to `STEPS`; _recall is "glove.recall". It draws no random numbers."""

    def add(act: Act) -> Act:
        def prepare(_parameters: EffectParameters, setting: Setting) -> Step:
            def step(batch: Batch, _draw: Draw) -> None:
                act(batch, setting)

            return step

        global STEPS
        name = f"glove{act.__name__.replace('_', '.', 1)}"
        STEPS += (Effect(name, summary, order, reads, writes, prepare=prepare),)
        return act

    return add


@_own(100, "takes the planned posture, the object's pose and the grip", (), ("posture_deg", "pose", "grip_n"))
def _recall(batch: Batch, setting: Setting) -> None:
    held = batch.condition.held
    batch.posture_deg = np.tile(held.posture_deg, (len(batch), 1))
    batch.pose = np.tile(held.pose, (len(batch), 1))
    batch.grip_n = np.full(len(batch), held.grip_n)


@_own(300, "sets the closing force of every switch", ("forces_n",), ("thresholds_n",))
def _threshold(batch: Batch, setting: Setting) -> None:
    batch.thresholds_n = np.full(batch.forces_n.shape[1], setting.threshold_n)


@_own(320, "closes the switches that are pressed hard enough", ("forces_n", "thresholds_n"), ("on_us", "off_us"))
def _close(batch: Batch, setting: Setting) -> None:
    let_go_us = NEVER if setting.let_go_us is None else setting.let_go_us
    closed = batch.forces_n > batch.thresholds_n
    batch.on_us = np.where(closed, 0, NEVER)
    batch.off_us = np.where(closed, let_go_us, NEVER)


@_own(400, "sets the times of frames", (), ("frame_us",))
def _frames(batch: Batch, setting: Setting) -> None:
    batch.frame_us = np.tile(frame_times(setting), (len(batch), 1))


@_own(500, "bends the CyberGlove's sensors with the hand", ("posture_deg", "frame_us"), ("sensors_deg",))
def _sense(batch: Batch, setting: Setting) -> None:
    felt = sensors_deg(batch.posture_deg)
    batch.sensors_deg = np.repeat(felt[:, None], batch.frame_us.shape[1], axis=1)


@_own(540, "converts the sensors to bytes by the subject's calibration", ("sensors_deg",), ("raw",))
def _encode(batch: Batch, setting: Setting) -> None:
    batch.raw = Calibration.of_subject(setting.seed, batch.condition.subject).bytes(batch.sensors_deg)


@_own(700, "reads every switch in every frame", ("on_us", "off_us", "frame_us", "delay_us"), ("bits",))
def _sample(batch: Batch, setting: Setting) -> None:
    at = batch.frame_us[:, :, None] if batch.delay_us is None else batch.frame_us[:, :, None] + batch.delay_us
    batch.bits = (batch.on_us[:, None] <= at) & (at < batch.off_us[:, None])
