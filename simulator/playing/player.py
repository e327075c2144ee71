"""Plays a performance on emulated devices at the pace of a clock."""

from collections.abc import Callable
from dataclasses import dataclass
from threading import Event
from time import monotonic_ns
from typing import Protocol

from .performance import Performance

Show = Callable[[list[bool], bytes], None]


class Log(Protocol):
    """Who is told of every frame when it is shown: its number, its grasp type, the monotonic clock in microseconds."""

    def __call__(self, row: int, grasp: str, time_us: int) -> None:
        """Take note."""


@dataclass(frozen=True, slots=True)
class Player:
    """Shows the frames of `performance` one after the other, each `period_us` after the one before, whatever showing
    them takes: lateness does not add up.
    """

    performance: Performance
    show: Show
    log: Log

    def play(self, stop: Event) -> bool:
        """Play all frames once. Returns False if `stop` was set before the last one had its time."""
        performance = self.performance
        start_us = monotonic_ns() // 1000
        for row in range(len(performance)):
            now_us = monotonic_ns() // 1000
            if stop.wait(max(start_us + row * performance.period_us - now_us, 0) / 1e6):
                return False
            self.show(performance.switches[row].tolist(), performance.sensors[row].tobytes())
            self.log(row, str(performance.grasps[row]), monotonic_ns() // 1000)
        return not stop.wait(performance.period_us / 1e6)
