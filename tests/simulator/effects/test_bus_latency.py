from typing import Any

import numpy as np
import pytest

from thenar.simulator.effects.bus_latency import prepare
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.effect import frame_times

from ..small import make_batch, make_draw, make_setting


def delay(
    parameters: dict[str, Any], rows: range = range(3), switches: int = 160, **changes: object
) -> tuple[np.ndarray, int]:
    """Return the delays of the switches (n, F, switches), and how many numbers were drawn."""
    batch = make_batch(rows)
    setting = make_setting(timed=True, **changes)
    batch.on_us = np.zeros((len(batch), switches), dtype=np.int64)
    batch.frame_us = np.tile(frame_times(setting), (len(batch), 1))
    draw = make_draw("bus.latency", batch)
    prepare(setting, **parameters)(batch, draw)
    assert batch.delay_us is not None
    return batch.delay_us, draw.draws["bus.latency"]


def test_one_port_follows_the_other_and_nothing_is_drawn() -> None:
    us, drawn = delay({"us_per_port": 100}, switches=40)
    assert us.tolist() == [100] * 16 + [200] * 16 + [300] * 8
    assert drawn == 0


def test_ports_are_read_in_turn_with_all_their_switches() -> None:
    us, drawn = delay({"us_per_port": 100, "jitter_us": 30.0})
    frames = us.shape[1]
    assert us.shape == (3, frames, 160)
    by_port = us.reshape(3, frames, 10, 16)
    assert (by_port == by_port[..., :1]).all()
    assert (np.diff(by_port[..., 0], axis=2, prepend=0) >= 100).all()
    assert drawn == 3 * frames * 10


def test_the_extra_time_is_on_average_what_was_said() -> None:
    us, _ = delay({"us_per_port": 100, "jitter_us": 50.0}, range(300))
    extra = np.diff(us[:, :, ::16], axis=2, prepend=0) - 100
    assert abs(extra.mean() - 50.0) < 1.0
    assert abs(extra.std() - 50.0) < 1.0


@pytest.mark.parametrize("parameters", [{"us_per_port": 101}, {"us_per_port": 90, "jitter_us": 11.0}])
def test_a_scan_that_lasts_longer_than_a_frame_is_refused(parameters: dict[str, Any]) -> None:
    prepare(make_setting(timed=True, period_us=1010), **parameters)
    with pytest.raises(
        SceneError, match=r"effects\.bus\.latency: 10 ports take 1010 µs .* period of frames is 1009 µs"
    ):
        prepare(make_setting(timed=True, period_us=1009), **parameters)
