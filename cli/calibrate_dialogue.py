"""What `thenar calibrate` says and asks while a CyberGlove is worn and read."""

import sys
from time import monotonic

import click
from rich.live import Live
from rich.table import Table

from thenar.drivers.calibration import GloveCalibration, Held, Pose, held, problems
from thenar.drivers.cyberglove import CyberGlove, GloveInfo
from thenar.drivers.errors import DeviceError

from .common import err
from .typed_lines import TypedLines

_WAIT_S = 0.05
_REFRESH_S = 0.1
# Pressing the key shakes the hand, and records from before it are still on their way.
_SETTLE_S = 0.15


class Guide:
    """Leads through the poses on stderr, with the sensors' bytes live where that is a terminal; answers are typed."""

    def __init__(self, glove: CyberGlove, info: GloveInfo, hold_s: float) -> None:
        self.info = info
        self._glove, self._hold_s = glove, hold_s
        self._console = err()
        self._typed = TypedLines(sys.stdin.fileno())
        for note in info.notes:
            self._say(note)

    def take(self, pose: Pose, number: str, flat: Held | None) -> Held | None:
        """Return what the pose gave, asking until it is taken; None to take the pose before it again.

        Raises click.Abort if the user quits, DeviceError if the glove is gone or unplugged.
        """
        while True:
            self._say(f"\nPose {number}, {pose.name}: {pose.instruction}")
            answer = self._asked("Enter when you hold it (b: back to the pose before, q: quit)", pose, "b")
            if answer == "b":
                return None
            found = held(self._samples())
            against = problems(self.info.names, flat, pose, found)
            if not against or self._is_kept(against, pose):
                return found

    def report_left_out(self, done: GloveCalibration) -> None:
        """Say which sensors got no line."""
        calibrated = {sensor.name for sensor in done.sensors}
        left_out = [name for name in self.info.names if name not in calibrated]
        if left_out:
            self._say(f"Not calibrated, because they did not move: {', '.join(left_out)}")

    def _is_kept(self, against: list[str], pose: Pose) -> bool:
        for problem in against:
            self._say(f"  {problem}")
        return self._asked("Enter to hold it again (k: keep it all the same, q: quit)", pose, "k") == "k"

    def _asked(self, question: str, pose: Pose, other: str) -> str:
        """Return "" or the `other` answer, asking again whoever types anything else."""
        while (answer := self._answered(question, pose)) not in ("", other):
            if answer == "q":
                raise click.Abort
            self._say(f"'{answer}' is no answer here")
        return answer

    def _answered(self, question: str, pose: Pose) -> str:
        self._say(question)
        with Live(console=self._console, transient=True, auto_refresh=False) as live:
            drawn = 0.0
            while (answer := self._typed.take()) is None:
                raw = self._raw()
                if raw is not None and self._console.is_terminal and monotonic() - drawn > _REFRESH_S:
                    live.update(self._table(raw, pose), refresh=True)
                    drawn = monotonic()
        return answer

    def _samples(self) -> list[bytes]:
        """Return what the sensors say for as long as a pose is held, once it has settled."""
        samples: list[bytes] = []
        settled = monotonic() + _SETTLE_S
        while monotonic() < settled:
            self._raw()
        end = settled + self._hold_s
        while monotonic() < end or not samples:
            raw = self._raw()
            samples += [] if raw is None else [raw]
        return samples

    def _raw(self) -> bytes | None:
        timed = self._glove.read(_WAIT_S)
        if timed is None:
            return None
        if timed[1].fault == "unplugged":
            raise DeviceError(f"{self._glove.url}: the glove is not plugged into its box")
        return timed[1].sensors

    def _table(self, raw: bytes, pose: Pose) -> Table:
        table = Table("sensor", "byte", "this pose's")
        for name, byte in zip(self.info.names, raw, strict=True):
            table.add_row(name, str(byte), "yes" if name in pose.degrees else "")
        return table

    def _say(self, text: str) -> None:
        self._console.print(text, soft_wrap=True)
