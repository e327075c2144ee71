"""What every scene does whatever its effects: the hand recalls a posture, switches close, frames are scanned and read.

`STEPS` holds these steps in the order in which they act within a stage; effects come in between (`effect.in_order`).
"""

import numpy as np

from ..body.cyberglove import Calibration, sensors_deg
from ..streams import Draw
from .batch import NEVER, Batch
from .effect import Effect, EffectParameters, Setting, Step, frame_times


def _recall(parameters: EffectParameters, setting: Setting) -> Step:
    def recall(batch: Batch, draw: Draw) -> None:
        held = batch.condition.held
        batch.posture_deg = np.tile(held.posture_deg, (len(batch), 1))
        batch.pose = np.tile(held.pose, (len(batch), 1))
        batch.grip_n = np.full(len(batch), held.grip_n)

    return recall


def _threshold(parameters: EffectParameters, setting: Setting) -> Step:
    def threshold(batch: Batch, draw: Draw) -> None:
        batch.thresholds_n = np.full(batch.forces_n.shape[1], setting.threshold_n)

    return threshold


def _close(parameters: EffectParameters, setting: Setting) -> Step:
    # The hand lets go when the frame after the read-out begins: a row that takes a while to read is still whole.
    let_go_us = setting.hold_us + setting.period_us if setting.release_us > 0 else NEVER

    def close(batch: Batch, draw: Draw) -> None:
        closed = batch.forces_n > batch.thresholds_n
        batch.on_us = np.where(closed, 0, NEVER)
        batch.off_us = np.where(closed, let_go_us, NEVER)

    return close


def _frames(parameters: EffectParameters, setting: Setting) -> Step:
    times = frame_times(setting)

    def frames(batch: Batch, draw: Draw) -> None:
        batch.frame_us = np.tile(times, (len(batch), 1))

    return frames


def _sense(parameters: EffectParameters, setting: Setting) -> Step:
    def sense(batch: Batch, draw: Draw) -> None:
        felt = sensors_deg(batch.posture_deg)
        batch.sensors_deg = np.repeat(felt[:, None], batch.frame_us.shape[1], axis=1)

    return sense


def _encode(parameters: EffectParameters, setting: Setting) -> Step:
    def encode(batch: Batch, draw: Draw) -> None:
        calibration = Calibration.of_subject(setting.seed, batch.condition.subject)
        batch.raw = calibration.bytes(batch.sensors_deg)

    return encode


def _sample(parameters: EffectParameters, setting: Setting) -> Step:
    def sample(batch: Batch, draw: Draw) -> None:
        at = batch.frame_us[:, :, None] if batch.delay_us is None else batch.frame_us[:, :, None] + batch.delay_us
        batch.bits = (batch.on_us[:, None] <= at) & (at < batch.off_us[:, None])

    return sample


STEPS: tuple[Effect, ...] = (
    Effect(
        name="glove.recall",
        summary="takes the planned posture, the object's pose and the grip",
        stage="posture",
        reads=(),
        writes=("posture_deg", "pose", "grip_n"),
        prepare=_recall,
    ),
    Effect(
        name="glove.threshold",
        summary="gives every switch the force that closes it",
        stage="switch",
        reads=("forces_n",),
        writes=("thresholds_n",),
        prepare=_threshold,
    ),
    Effect(
        name="glove.close",
        summary="closes the switches that are pressed hard enough",
        stage="switch",
        reads=("forces_n", "thresholds_n"),
        writes=("on_us", "off_us"),
        prepare=_close,
    ),
    Effect(
        name="glove.frames",
        summary="says when frames are scanned",
        stage="frame",
        reads=(),
        writes=("frame_us",),
        prepare=_frames,
    ),
    Effect(
        name="glove.sense",
        summary="bends the CyberGlove's sensors with the hand",
        stage="sense",
        reads=("posture_deg", "frame_us"),
        writes=("sensors_deg",),
        prepare=_sense,
    ),
    Effect(
        name="glove.encode",
        summary="makes bytes of the sensors as the subject's calibration has it",
        stage="sense",
        reads=("sensors_deg",),
        writes=("raw",),
        prepare=_encode,
    ),
    Effect(
        name="glove.sample",
        summary="reads every switch in every frame",
        stage="read",
        reads=("on_us", "off_us", "frame_us", "delay_us"),
        writes=("bits",),
        prepare=_sample,
    ),
)
