"""Rest and press of a glove's taxels, learnt with the person who wears it."""

import sys
from time import monotonic
from typing import TYPE_CHECKING

import click
from rich.live import Live
from rich.table import Table

from .calibrate_command import TypedLines
from .common import err

if TYPE_CHECKING:
    from thenar.runtime.harness.wiring import Harness
    from thenar.runtime.live.sources import Sources
    from thenar.runtime.taxels import TaxelCalibration

_WAIT_US = 50_000
_PATIENCE_S = 5.0
_REFRESH_S = 0.1
# Somebody who presses for an hour is not calibrating.
_MOST_FRAMES = 1_000_000

Codes = tuple[int | None, ...]


class TaxelGuide:
    """Asks on stderr for a glove at rest and for a press of every taxel, and shows their counts meanwhile."""

    def __init__(self, harness: "Harness", sources: "Sources", hold_s: float) -> None:
        self.names = harness.taxel_names
        self._sources, self._hold_s = sources, hold_s
        self._console = err()
        self._typed = TypedLines(sys.stdin.fileno())

    def calibration(self, subject: str, newtons: float | None) -> "TaxelCalibration":
        """Return what was learnt. Raises DeviceError where a device sends no taxels, click.Abort if the user quits."""
        from thenar.runtime.taxels import TaxelCalibration, learnt_lines

        self._meet()
        self._say("Leave every taxel alone, the hand open: press nothing.")
        self._until_enter("Enter when nothing is pressed (q: quit)", [])
        rested = self._held()
        self._say("Press every taxel once, firmly, for half a second each, in any order.")
        pressed = self._until_enter("Enter when all were pressed (q: quit)", rested)
        lines = learnt_lines(self.names, rested, pressed, 1.0 if newtons is None else newtons)
        found = {line.name for line in lines}
        if missing := [name for name in self.names if name not in found]:
            self._say(f"Not calibrated, because their counts did not move: {', '.join(missing)}")
        return TaxelCalibration(subject=subject, unit="press" if newtons is None else "N", taxels=lines)

    def _meet(self) -> None:
        """Wait for the first codes."""
        from thenar.drivers.errors import DeviceError

        end = monotonic() + _PATIENCE_S
        while not self._frames():
            self._sources.raise_settings()
            if monotonic() > end:
                states = self._sources.devices()
                wrong = next(
                    (f"{state.name}: {state.error}" for state in states if state.error), "no device sends taxels"
                )
                raise DeviceError(f"{wrong}; nothing is calibrated")

    def _frames(self) -> list[Codes]:
        from thenar.runtime.frames import SwitchFrame

        arrived = self._sources.take(_WAIT_US).arrived
        return [frame.taxels for frame in arrived if isinstance(frame, SwitchFrame) and frame.taxels is not None]

    def _held(self) -> list[Codes]:
        """Return what comes for as long as a pose is held."""
        codes: list[Codes] = []
        end = monotonic() + self._hold_s
        while monotonic() < end or not codes:
            codes += self._frames()
        return codes

    def _until_enter(self, question: str, rested: list[Codes]) -> list[Codes]:
        """Return what comes until Enter is pressed."""
        self._say(question)
        codes: list[Codes] = []
        drawn = 0.0
        with Live(console=self._console, transient=True, auto_refresh=False) as live:
            while (answer := self._typed.take()) is None:
                codes += self._frames()
                del codes[:-_MOST_FRAMES]
                if codes and self._console.is_terminal and monotonic() - drawn > _REFRESH_S:
                    live.update(self._table(codes[-1], rested), refresh=True)
                    drawn = monotonic()
        if answer == "q":
            raise click.Abort
        return codes

    def _table(self, codes: Codes, rested: list[Codes]) -> Table:
        table = Table("taxel", "counts", "at rest")
        rest: Codes = rested[-1] if rested else (None,) * len(self.names)
        for name, code, still in zip(self.names, codes, rest, strict=True):
            table.add_row(name, *("" if count is None else str(count) for count in (code, still)))
        return table

    def _say(self, text: str) -> None:
        self._console.print(text, soft_wrap=True)
