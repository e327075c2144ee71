"""The live terminal view of `thenar run`: the grasp, its confidence, and the state of the devices."""

from collections.abc import Callable, Sequence
from time import monotonic

from thenar.runtime.published import DeviceHealth, HealthReport, LiveGrasp, OutputTrouble, Quarantined

from .consoles import Live, Printed, Text, bar, grid

Devices = Callable[[], Sequence[DeviceHealth]]

_REDRAW_S = 0.1
_STYLES = {"ok": "bold green", "changing": "bold cyan", "degraded": "bold yellow", "unknown": "bold red"}
_SHOWN = 6


class LiveView(Live):
    """Draws the newest grasp ten times a second, in place, on a console whose stream keeps nobody waiting."""

    _due_s = 0.0

    def show(self, grasp: LiveGrasp, devices: Devices, health: HealthReport | None = None) -> None:
        """Draw this if it is time; the devices are queried then."""
        if monotonic() < self._due_s:
            return
        self._due_s = monotonic() + _REDRAW_S
        wrong: tuple[Quarantined | OutputTrouble, ...] = ()
        if health is not None:
            wrong = (*health.quarantined, *health.outputs)
        self.update(drawn(grasp, devices(), wrong))


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
