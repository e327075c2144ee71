"""The live terminal view of `thenar run`: the grasp, its confidence, and the state of the devices."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from threading import Event, Thread
from typing import Self

from thenar.runtime.published import DeviceHealth, HealthReport, LiveGrasp, OutputTrouble, Quarantined

from .consoles import Console, Live, Printed, Text, bar, grid

Devices = Callable[[], Sequence[DeviceHealth]]

_REDRAW_S = 0.1
_STYLES = {"ok": "bold green", "changing": "bold cyan", "degraded": "bold yellow", "unknown": "bold red"}
_SHOWN = 6


class LiveView:
    """Draws the newest grasp ten times a second, in place.

    It draws in a separate thread: a terminal that is held (Ctrl-S), slow or closed delays nothing else.
    """

    def __init__(self, console: Console) -> None:
        self._live = Live(console)
        self._newest: tuple[LiveGrasp, Devices, HealthReport | None] | None = None
        self._closing = Event()
        self._thread = Thread(target=self._draw, name="thenar view", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        self._thread.join()
        with suppress(OSError):
            self._live.__exit__()

    def show(
        self,
        grasp: LiveGrasp,
        devices: Devices,
        health: HealthReport | None = None,
    ) -> None:
        """Draw this next, unless something newer arrives first; the devices are queried then."""
        self._newest = grasp, devices, health

    def _draw(self) -> None:
        shown = None
        # The thread also ends when the terminal closes.
        with suppress(OSError):
            while not self._closing.wait(_REDRAW_S):
                newest = self._newest
                if newest is not None and newest is not shown:
                    grasp, devices, health = shown = newest
                    wrong = list[Quarantined | OutputTrouble]()
                    if health is not None:
                        wrong += [*health.quarantined, *health.outputs]
                    self._live.update(drawn(grasp, devices(), wrong))


def drawn(
    grasp: LiveGrasp,
    devices: Sequence[DeviceHealth],
    wrong: Sequence[Quarantined | OutputTrouble] = (),
) -> Printed:
    """Return the view of one moment."""
    table = grid(2)
    table.add_row("grasp", Text(grasp.grasp, _STYLES[grasp.health]))
    table.add_row("", f"{bar(grasp.probability)} {grasp.probability:5.1%}")
    table.add_row("this frame", f"{grasp.candidate}, ahead by {grasp.margin} steps")
    table.add_row("segment", _segment(grasp))
    table.add_row("health", Text(grasp.health, _STYLES[grasp.health]))
    if grasp.lost:
        more = f" and {len(grasp.lost) - _SHOWN} more" if len(grasp.lost) > _SHOWN else ""
        table.add_row("missing", ", ".join(grasp.lost[:_SHOWN]) + more)
    for one in wrong:
        table.add_row(one.name, Text(one.what, "yellow"))
    table.add_row("age", f"switches {_ms(grasp.switch_age_us)}, glove {_ms(grasp.glove_age_us)}")
    table.add_row("frame", str(grasp.number))
    for device in devices:
        table.add_row(device.name, Text(device.error, "red") if device.error else "connected")
    return table


def _segment(grasp: LiveGrasp) -> str:
    """Return "3, PMF: held, 1.2 s"."""
    if grasp.segment_us is None:
        return f"none, {grasp.segment} so far"
    return f"{grasp.segment}, {grasp.segment_type}: {grasp.state}, {(grasp.time_us - grasp.segment_us) / 1e6:.1f} s"


def _ms(age_us: int | None) -> str:
    return "none yet" if age_us is None else f"{age_us / 1000:.1f} ms"
