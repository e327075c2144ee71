"""The view of a guided collection: the grasp to take, the countdown, the captured readings, and the progress."""

from collections.abc import Sequence
from typing import Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from thenar.compiler.recordings.taxonomy import MOVEMENTS, Taxonomy
from thenar.runtime.live.sources import DeviceState
from thenar.runtime.published import NONE
from thenar.runtime.recording.guide import CollectionGuide, Stage

from .guide_keys import LETTERS

_REDRAW_US = 100_000


class GuideView:
    """Draws in place on a terminal, ten times a second and at every change; elsewhere prints one line per change."""

    def __init__(self, console: Console, taxonomy: Taxonomy) -> None:
        self._console = console
        self._full = dict(zip(taxonomy.types, taxonomy.full_names, strict=True))
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None
        self._due_us = 0
        self._shown = -1
        self._said = ""

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def show(self, now_us: int, guide: CollectionGuide, devices: Sequence[DeviceState]) -> None:
        """Show the guide's state, if it changed or the next refresh is due."""
        if self._live is None:
            self._say(guide, devices)
        elif now_us >= self._due_us or self._shown != guide.step:
            self._due_us = now_us + _REDRAW_US
            self._shown = guide.step
            self._live.update(self._drawn(now_us, guide, devices), refresh=True)

    def _say(self, guide: CollectionGuide, devices: Sequence[DeviceState]) -> None:
        errors = "; ".join(device.error for device in devices if not device.connected)
        why = f" ({errors})" if errors else ""
        problem = f"not captured: {guide.problem}{why}; " if guide.problem else ""
        waits = f"the countdown waits: {guide.lost}{why}; " if _waits(guide) else ""
        line = f"{self._task(guide)}: {problem}{waits}{_keys(guide)}"
        if line != self._said and guide.stage is not Stage.OVER:
            self._said = line
            self._console.print(line, soft_wrap=True)

    def _drawn(self, now_us: int, guide: CollectionGuide, devices: Sequence[DeviceState]) -> RenderableType:
        table = Table.grid(padding=(0, 2))
        skipped = f", {guide.skipped} skipped" if guide.skipped else ""
        bar = ProgressBar(guide.total, guide.done, width=40)
        table.add_row("done", Text(f"{guide.done} of {guide.total}{skipped}"), bar)
        for device in devices:
            table.add_row(device.name, Text("connected") if device.connected else Text(device.error, style="red"))
        stage = Text(self._standing(now_us, guide), style="bold")
        return Group(table, Text(), Text(self._task(guide), style="bold cyan"), stage, Text(_keys(guide)))

    def _task(self, guide: CollectionGuide) -> str:
        trial = guide.trial
        if trial is None:
            return f"{guide.done} of {guide.total}: no trial is left"
        place = f"{guide.done + guide.skipped + 1} of {guide.total}"
        if trial.grasp == NONE and NONE not in self._full:
            return f"{place}: nothing held, {trial.object}: {MOVEMENTS.get(trial.object, 'touch nothing')}"
        full = self._full[trial.grasp]
        name = trial.grasp if full == trial.grasp else f"{full} ({trial.grasp})"
        return f"{place}: {name}, object {trial.object}"

    def _standing(self, now_us: int, guide: CollectionGuide) -> str:
        if _waits(guide):
            return f"the countdown waits: {guide.lost}"
        if guide.stage is Stage.PAUSED:
            return "paused; nothing is recorded meanwhile"
        if guide.problem:
            return f"not captured: {guide.problem}"
        if guide.stage is Stage.COUNTDOWN:
            doing = "move so" if guide.trial is not None and guide.trial.grasp == NONE else "hold it"
            return f"{doing} in {guide.seconds_left(now_us):.1f} s"
        if guide.stage is Stage.MOVING:
            return f"move so for {guide.seconds_left(now_us):.1f} s more"
        if guide.stage is not Stage.REVIEW:
            return ""
        switches, glove = guide.captured
        closed = "" if switches is None else f"{switches.closed.bit_count()} switches closed"
        sensors = "" if glove is None else "glove " + " ".join(map(str, glove.sensors))
        return "captured: " + ", ".join(filter(None, (closed, sensors)))


def _waits(guide: CollectionGuide) -> bool:
    """Return whether no countdown can start, because something is not read."""
    return bool(guide.lost) and guide.stage in (Stage.READY, Stage.PAUSED)


def _keys(guide: CollectionGuide) -> str:
    """Return the keys that are active now: "Enter: start the countdown   q: leave"."""
    return "   ".join(f"{LETTERS[key]}: {what}" for key, what in guide.offered().items())
