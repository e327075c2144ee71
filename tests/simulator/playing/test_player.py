from itertools import pairwise
from threading import Event

import numpy as np

from thenar.drivers.calibration import GloveCalibration
from thenar.simulator.playing.performance import Performance


def performance(frames: int, period_us: int) -> Performance:
    random = np.random.default_rng(1)
    return Performance(
        switches=random.random((frames, 3)) < 0.5,
        switch_names=("a", "b", "c"),
        sensors=random.integers(1, 256, (frames, 18)).astype(np.uint8),
        grasps=np.array([f"g{number}" for number in range(frames)]),
        period_us=period_us,
        calibration=GloveCalibration(sensors=(), unit="deg", subject=""),
    )


def test_every_frame_is_shown_once_in_order_and_never_early() -> None:
    played, shown, log = performance(20, 2000), list[tuple[list[bool], bytes]](), list[tuple[int, str, int]]()
    assert played.play(lambda bits, raw, *_: shown.append((bits, raw)), lambda *line: log.append(line), Event())
    assert [bits for bits, _ in shown] == played.switches.tolist()
    assert [raw for _, raw in shown] == [row.tobytes() for row in played.sensors]
    assert [(row, grasp) for row, grasp, _ in log] == list(enumerate(played.grasps.tolist()))
    start = log[0][2]
    assert all(time_us >= start + (row - 1) * 2000 for row, _, time_us in log)
    assert all(earlier[2] <= later[2] for earlier, later in pairwise(log))


def test_stopping_ends_it_at_once_and_it_says_so() -> None:
    stop = Event()
    played = performance(1000, 60_000_000)
    assert not played.play(lambda *_: stop.set(), lambda *_: None, stop)
