"""The page of a guided collection: what it shows of the Guide, and the keys that are pressed there.

Every browser that is open shows the same, and the same keys count in each.
"""

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

from ..frames import GloveFrame, Mask, SwitchFrame
from ..live.sources import DeviceState
from ..published import NONE
from ..recording.guide import Guide, Key, Trial
from ..recording.session import Session
from .presses import Presses
from .server import Server, message

# So often the page is told of a hand that moves. A change of stage is told at once.
_PERIOD_US = 50_000


class GuidePage:
    """Serves the page of a collection until it is left; a context manager.

    Parameters
    ----------
    address, token
        As for `Server`.
    session : Session
        What is recorded; it has a collection.
    hands : mapping
        What hand.js draws: "glove", whose bits are the session's switches and whose joints are its sensors, and "pose",
        whose joints are those of a pose.
    shown : callable
        Returns how a trial is shown: "title", "detail", and a "pose" of joints in degrees or None.

    Raises
    ------
    SettingError, SinkError
        As `Server` does.
    """

    def __init__(
        self,
        address: str,
        *,
        token: str | None,
        session: Session,
        hands: Mapping[str, object],
        shown: Callable[[Trial], Mapping[str, object]],
    ) -> None:
        collection = session.collection
        assert collection is not None
        self._shown, self._switches = shown, len(session.switches)
        calibrated = () if session.calibration is None else session.calibration.sensors
        lines = {line.name: line for line in calibrated}
        self._lines = [lines.get(name) for name in session.sensors]
        self._presses = Presses(Key)
        self._due_us, self._step = 0, -1
        first = message(
            "collection",
            subject=collection.subject,
            types=[*dict.fromkeys(task.grasp for task in collection.tasks)],
            switches=session.switches,
            sensors=session.sensors,
            taxels=session.taxels,
        )
        self._first = (first, message("hands", hands))
        self._server = Server("collect", address, token=token, on_message=self._presses.take, hello=lambda: self._first)
        self.url = self._server.url

    def press(self, now_us: int, guide: Guide) -> None:
        """Press what was pressed on a page since the last call and was meant for what `guide` is at."""
        for key in self._presses.due(lambda: guide.step):
            guide.press(now_us, key)

    def show(self, now_us: int, guide: Guide, devices: Sequence[DeviceState]) -> None:
        """Show where `guide` stands, if it is time to, or news."""
        if now_us < self._due_us and guide.step == self._step:
            return
        self._due_us, self._step = now_us + _PERIOD_US, guide.step
        switches, glove = guide.captured
        trial = guide.trial
        self._server.publish(
            "guide",
            message(
                "guide",
                step=guide.step,
                stage=guide.stage.value,
                place=guide.done + guide.skipped + 1,
                done=guide.done,
                skipped=guide.skipped,
                total=guide.total,
                left_s=guide.seconds_left(now_us),
                problem=guide.problem,
                offered={key.value: what for key, what in guide.offered().items()},
                trial=trial and {"grasp": trial.grasp, "none": trial.grasp == NONE, **self._shown(trial)},
                devices=[
                    {"name": device.name, "connected": device.connected, "error": device.error} for device in devices
                ],
                **self._seen(switches, glove),
            ),
        )

    def tell(self, study: Mapping[str, object]) -> None:
        """Show what recognition is so far, or why that is not known."""
        self._server.publish("study", message("study", **study))

    def close(self) -> None:
        """End the page."""
        self._server.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _seen(self, switches: SwitchFrame | None, glove: GloveFrame | None) -> dict[str, object]:
        """Return what the glove sees: a character a switch, "1" closed, "0" open, "x" not read; the joints' values, in
        degrees where they are calibrated, null where they are not measured; the taxels' codes.
        """
        joints: list[float | None] = []
        if glove is not None and glove.plugged:
            joints = [
                None if not raw else float(raw) if line is None else round(line.value(raw), 1)
                for raw, line in zip(glove.sensors, self._lines, strict=True)
            ]
        return {
            "closed": "" if switches is None else _letters(switches, self._switches),
            "joints": joints,
            "taxels": () if switches is None else switches.taxels or (),
        }


def _letters(frame: SwitchFrame, switches: int) -> str:
    unknown: Mask = frame.lost | frame.unread
    return "".join(
        "x" if unknown >> number & 1 else "1" if frame.closed >> number & 1 else "0" for number in range(switches)
    )
