import msgspec
import numpy as np
import pytest

from thenar.simulator.effects.frame_jitter import MEMBER, prepare
from thenar.simulator.pipeline.effect import SceneSetting, frame_times

from ..small import make_batch, make_draw, make_setting


def jittered(setting: SceneSetting, sd_us: float, rows: range) -> np.ndarray:
    batch = make_batch(rows)
    batch.frame_us = np.tile(frame_times(setting), (len(batch), 1))
    prepare(setting, sd_us=sd_us)(batch, make_draw("frame.jitter", batch))
    return batch.frame_us


@pytest.mark.parametrize("sd_us", [100.0, 5_000.0, 100_000.0])
def test_frames_keep_their_order_however_late(sd_us: float) -> None:
    times = jittered(make_setting(timed=True), sd_us, range(50))
    assert (np.diff(times, axis=1) >= 0).all()


def test_frames_stray_as_much_as_said() -> None:
    setting = make_setting(timed=True)
    late = jittered(setting, 300.0, range(400)) - frame_times(setting)
    assert abs(late.mean()) < 10.0
    assert abs(late.std() - 300.0) < 10.0


@pytest.mark.parametrize("sd_us", [0.0, -1.0, 2e6])
def test_impossible_spreads_are_refused(sd_us: float) -> None:
    with pytest.raises(msgspec.ValidationError, match="sd_us"):
        msgspec.convert({"sd_us": sd_us}, MEMBER.parameters())
