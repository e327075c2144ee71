"""When frames are scanned, how many at a time, and which random numbers belong to which frame."""

import numpy as np
from numpy.typing import NDArray

from .effect import Setting

Integers = NDArray[np.int64]

# So many frames are simulated at a time: with all that is worked out of them, each takes two to five kilobytes.
_MOST = 50_000


def frame_times(setting: Setting) -> Integers:
    """Return when the frames (F,) of a repetition begin, in microseconds from first contact.

    They are counted from the one at hold_us, whose row is read out: so it is always among them. Where nothing lives in
    time it is the only one.
    """
    if not setting.timed:
        return np.array([setting.hold_us], dtype=np.int64)
    after = setting.release_us // setting.period_us
    return setting.hold_us + setting.period_us * np.arange(-hold_frame(setting), after + 1, dtype=np.int64)


def hold_frame(setting: Setting) -> int:
    """Return the number of the frame at hold_us."""
    return (setting.hold_us - setting.first_us) // setting.period_us if setting.timed else 0


def at_a_time(setting: Setting, repetitions: int) -> int:
    """Return how many repetitions are simulated at a time where `repetitions` would be if they had one frame each.

    Fewer where each has so many frames that they would fill the memory, but at least one.
    """
    return max(min(repetitions, _MOST // len(frame_times(setting))), 1)


def drawn_rows(setting: Setting) -> NDArray[np.intp]:
    """Return which row of the random numbers of a repetition each frame (F,) takes.

    The frame at hold_us takes the first, so that its numbers are the same whether or not there are others.
    """
    count = len(frame_times(setting))
    return (np.arange(count, dtype=np.intp) - hold_frame(setting)) % count
