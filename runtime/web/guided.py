"""The page of a guided collection: its view of the guide, and the keys pressed there.

Every open browser shows the same, and keys count in each.
"""

from collections.abc import Callable, Mapping, Sequence

from thenar.drivers.closing import Closing

from ..frames import SwitchFrame
from ..live.sources import DeviceState
from ..published import NONE
from ..recording.guide import CollectionGuide, Key, Stage, Trial
from ..recording.session import Session
from .presses import Presses
from .server import Server, message

# Interval at which the page is sent hand movements. A change of stage is sent at once.
_PERIOD_US = 50_000


class GuidePage(Closing):
    """Serves the page of a collection until it is left; a context manager.

    Parameters
    ----------
    address, token
        As for `Server`.
    session : Session
        The recorded session, which has a collection.
    hands : mapping
        The drawings of hand.js: "glove", whose bits are the session's switches and whose joints are its sensors,
        and "pose", whose joints are those of a pose.
    shown : callable
        Returns the page's view of a trial: "title", "detail", and a "pose" of joints in degrees or None.

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
        given = session.taxel_calibration
        fitted = [None if given is None else given.line(name) for name in session.taxels]
        # From rest to press of each taxel if it is calibrated, else the range seen so far.
        self._taxel_ends = [None if line is None else (line.rest, line.press) for line in fitted]
        self._calibrated = [line is not None for line in fitted]
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

    def press(self, now_us: int, guide: CollectionGuide) -> None:
        """Pass the keys pressed since the last call to `guide`, if they were meant for its current step."""
        for key in self._presses.due(lambda: guide.step):
            guide.press(now_us, key)

    def show(self, now_us: int, guide: CollectionGuide, devices: Sequence[DeviceState]) -> None:
        """Show the state of `guide`, if it changed or the next refresh is due."""
        if now_us < self._due_us and guide.step == self._step:
            return
        self._due_us, self._step = now_us + _PERIOD_US, guide.step
        trial, newest_us = guide.trial, guide.newest_us
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
                lost=guide.lost,
                time_us=newest_us,
                age_us=newest_us and now_us - newest_us,
                offered={key.value: what for key, what in guide.offered().items()},
                trial=trial and {"grasp": trial.grasp, "none": trial.grasp == NONE, **self._shown(trial)},
                devices=[
                    {"name": device.name, "connected": device.connected, "error": device.error} for device in devices
                ],
                **self._seen(now_us, guide),
            ),
        )

    def tell(self, study: Mapping[str, object]) -> None:
        """Show the accuracy so far, or why it is not known."""
        self._server.publish("study", message("study", **study))

    def close(self) -> None:
        """Close the page."""
        self._server.close()

    def _seen(self, now_us: int, guide: CollectionGuide) -> dict[str, object]:
        """Return the glove's readings, or those that were captured: one character per switch, "1" closed, "0" open, "x"
        not read; the joint values, in degrees if calibrated, null if not measured, none if the newest record is old;
        how far each taxel is pressed, 0 to 1.
        """
        switches, glove = guide.captured
        captured = guide.stage is Stage.REVIEW
        joints: list[float | None] = []
        if glove is not None and glove.plugged and (captured or now_us - glove.time_us <= guide.old_us):
            joints = [
                None if not raw else float(raw) if line is None else round(line.value(raw), 1)
                for raw, line in zip(glove.sensors, self._lines, strict=True)
            ]
        return {
            "closed": "" if switches is None else _letters(switches, self._switches),
            "joints": joints,
            "taxels": () if switches is None else self._pressed(switches.taxels or ()),
        }

    def _pressed(self, codes: Sequence[int | None]) -> list[float | None]:
        """Return how far each taxel is pressed, 0 to 1, or None if it was not read."""
        found: list[float | None] = []
        for place, code in enumerate(codes):
            if code is None:
                found.append(None)
                continue
            rest, press = self._taxel_ends[place] or (code, code)
            if not self._calibrated[place]:
                rest, press = min(rest, code), max(press, code)
            self._taxel_ends[place] = rest, press
            found.append(0.0 if rest == press else round(min(max((code - rest) / (press - rest), 0.0), 1.0), 3))
        return found


def _letters(frame: SwitchFrame, switches: int) -> str:
    return "".join(
        "x" if frame.lost >> number & 1 else "1" if frame.closed >> number & 1 else "0" for number in range(switches)
    )
