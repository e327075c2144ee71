"""The page of a guided collection or calibration: what to do now, what the glove reads, and the keys pressed there.

Every open browser shows the same, and keys count in each.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import ceil
from typing import Any

from thenar.drivers.closing import Closing
from thenar.drivers.cyberglove_protocol import SENSORS_22
from thenar.drivers.errors import SettingError

from ..frames import SwitchFrame
from ..hand import HandDrawing, drawn_joints
from ..manifest import Calibration
from ..names import list_names
from ..posing import POSE_KEYS, PoseGuide, PoseStage
from ..published import NONE, DeviceHealth
from ..recording.guide import KEYS, CollectionGuide, Trial
from ..recording.session import Session
from .server import Server, message

# Interval at which the page is sent hand movements. A change of stage is sent at once.
_PERIOD_US = 50_000

# The pose in which hand.js draws an idle hand, and further angles that a pose needs to be recognisable, in degrees.
_RELAXED = {
    "thumb_rotation": 20.0,
    "thumb_abduction": 25.0,
    "middle_index_abduction": 5.0,
    "ring_middle_abduction": 5.0,
    "little_ring_abduction": 6.0,
}
_FURTHER = {
    "fist": {"thumb_rotation": 75.0, "thumb_abduction": 30.0, "thumb_mpj": 45.0, "thumb_ij": 45.0},
    "thumb across": {"thumb_abduction": 15.0, "thumb_mpj": 45.0, "thumb_ij": 25.0},
}


def posed_hand() -> HandDrawing:
    """Return the drawing of a hand that shows poses: the joints of a CyberGlove with 22 sensors, and no switch."""
    joints = [Calibration(at, name, "deg", 0, 0.0, 90, 90.0) for at, name in enumerate(SENSORS_22)]
    return HandDrawing(view="", placed=False, radius_mm=1.0, switches=(), taxels=(), joints=drawn_joints(joints))


def posed(degrees: Mapping[str, float]) -> list[float]:
    """Return the angles of all joints of `posed_hand` in a pose that sets some, by their names; the rest is relaxed."""
    angles = {**_RELAXED, **degrees}
    return [angles.get(name, 0.0) for name in SENSORS_22]


class GuidePage(Closing):
    """Serves the page of a guide until it is left; a context manager.

    A press names the step that it was meant for: one that arrives too late, because another browser was quicker or
    something happened in between, has no effect.

    Parameters
    ----------
    address, token
        As for `Server`.
    keys : sequence of str
        The keys of the guide.
    view : callable
        Returns what is shown of the guide at a moment: it gets the moment, the guide, and what `show` gets in addition.
    about : mapping
        What stays: "what" is done, the "subject", what is asked before one leaves ("leave"), the sensors in the "table"
        of bytes, and whether there is a "study".
    hands : mapping
        The drawings of hand.js: "pose", whose joints are those of `posed_hand`, and, of a collection, "glove", whose
        bits are the session's switches and whose joints are its sensors.

    Attributes
    ----------
    url : str
        As of `Server`.

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
        keys: Sequence[str],
        view: Callable[..., dict[str, object]],
        about: Mapping[str, object],
        hands: Mapping[str, object],
    ) -> None:
        self._keys, self._view = keys, view
        self._pressed: deque[tuple[int, str]] = deque(maxlen=64)
        self._due_us, self._step = 0, -1
        self._shown: dict[str, object] = {}
        first = (message("about", about), message("hands", hands))
        self._server = Server("guided", address, token=token, on_message=self._take, hello=lambda: first)
        self.url = self._server.url

    def press(self, now_us: int, guide: Any) -> None:
        """Pass the keys pressed since the last call to `guide`, if they were meant for its current step."""
        while self._pressed:
            meant, key = self._pressed.popleft()
            if meant == guide.step:
                guide.press(now_us, key)

    def show(self, now_us: int, guide: Any, *more: object) -> None:
        """Show the state of `guide`, if it changed or the next refresh is due."""
        if now_us < self._due_us and guide.step == self._step:
            return
        self._due_us, self._step = now_us + _PERIOD_US, guide.step
        self._shown = {"step": guide.step, "stage": guide.stage, **self._view(now_us, guide, *more)}
        self._server.publish("guide", message("guide", self._shown))

    def end(self, sentence: str) -> None:
        """Show how it ended."""
        self._server.publish(
            "guide", message("guide", self._shown | {"stage": "over", "says": sentence, "offered": {}})
        )

    def study(self, study: Mapping[str, object]) -> None:
        """Show the accuracy so far, or why it is not known."""
        self._server.publish("study", message("study", **study))

    def close(self) -> None:
        """Close the page, once it shows the last message."""
        self._server.close()

    def _take(self, asked: Mapping[str, object]) -> None:
        step, key = asked.get("step"), str(asked["do"])
        if key not in self._keys or type(step) is not int:
            raise SettingError(f"this page presses {', '.join(self._keys)}, each at a step")
        self._pressed.append((step, key))


def collection_page(
    address: str,
    *,
    token: str | None,
    session: Session,
    hands: Mapping[str, object],
    shown: Callable[[Trial], Mapping[str, object]],
) -> GuidePage:
    """Return the page of a collection of this session, whose `show` gets the devices.

    `shown` gives "title", "detail" and "pose" of a trial: the angles of `posed_hand`, or None.
    """
    assert session.collection is not None
    leave = "Leave? The recording is kept, and the same command continues it another time."
    about = {"what": "Subject", "subject": session.collection.subject, "leave": leave, "table": (), "study": True}
    return GuidePage(address, token=token, keys=KEYS, view=_CollectionView(session, shown), about=about, hands=hands)


class _CollectionView:
    """The view of a collection. What taxels without a calibration mean depends on what was read so far."""

    def __init__(self, session: Session, shown: Callable[[Trial], Mapping[str, object]]) -> None:
        self._session, self._shown = session, shown
        calibrated = () if session.calibration is None else session.calibration.sensors
        lines = {line.name: line for line in calibrated}
        self._lines = [lines.get(name) for name in session.sensors]
        given = session.taxel_calibration
        fitted = [None if given is None else given.line(name) for name in session.taxels]
        # From rest to press of each taxel if it is calibrated, else the range seen so far.
        self._taxel_ends = [None if line is None else (line.rest, line.press) for line in fitted]
        self._calibrated = [line is not None for line in fitted]

    def __call__(self, now_us: int, guide: CollectionGuide, devices: Sequence[DeviceHealth]) -> dict[str, object]:
        trial, newest_us = guide.trial, guide.newest_us
        number = {"review": "✓"}.get(guide.stage, "")
        if guide.stage in ("countdown", "moving"):
            number = str(ceil(guide.seconds_left(now_us)))
        nothing = {"title": "No trial is left", "detail": "", "pose": None}
        return {
            "count": f"{guide.done} of {guide.total} trials done" + f", {guide.skipped} skipped" * bool(guide.skipped),
            "done": guide.done,
            "total": guide.total,
            **(nothing if trial is None else self._shown(trial)),
            "says": _collection_says(guide),
            "number": number,
            "problems": [f"not captured: {guide.problem}"] if guide.problem else [],
            "offered": guide.offered(),
            "time_us": newest_us,
            "age_us": newest_us and now_us - newest_us,
            "devices": [
                {"name": device.name, "connected": device.connected, "error": device.error} for device in devices
            ],
            "rows": (),
            **self._readings(now_us, guide),
        }

    def _readings(self, now_us: int, guide: CollectionGuide) -> dict[str, object]:
        """Return the glove's readings, or those that were captured: one character per switch, "1" closed, "0" open, "x"
        not read; the joint values, in degrees if calibrated, null if not measured, none if the newest record is old;
        how far each taxel is pressed, 0 to 1; and a sentence on them.
        """
        switches, glove = guide.captured
        session, captured = self._session, guide.stage == "review"
        joints: list[float | None] = []
        if glove is not None and glove.plugged and (captured or now_us - glove.time_us <= guide.old_us):
            joints = [
                None if not raw else float(raw) if line is None else round(line.value(raw), 1)
                for raw, line in zip(glove.sensors, self._lines, strict=True)
            ]
        closed = "" if switches is None else _letters(switches, len(session.switches))
        taxels = [] if switches is None else self._pressed(switches.taxels or ())
        letters = [None if letter == "x" else letter == "1" for letter in closed]
        presses = [None if share is None else share >= 0.5 for share in taxels]
        measured = [None if value is None else True for value in joints]
        said = (
            _counted(session.switches, letters, "switches closed"),
            _counted(session.taxels, presses, "taxels pressed"),
            _counted(session.sensors, measured, "joints measured"),
        )
        return {"closed": closed, "joints": joints, "taxels": taxels, "sees": "; ".join(filter(None, said))}

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


def _collection_says(guide: CollectionGuide) -> str:
    """Return the next action in words."""
    none = guide.trial is not None and guide.trial.grasp == NONE
    waits = f"the countdown waits: {guide.lost}" if guide.lost else ""
    if guide.stage == "done" and guide.skipped:
        return "no trial is left; the skipped ones come another time"
    return {
        "ready": waits or "Enter starts the countdown",
        "countdown": "move so in" if none else "take the grasp: hold it in",
        "moving": "move so for",
        "review": "captured: keep it?",
        "paused": "; ".join(filter(None, ("paused; nothing is recorded meanwhile", waits))),
        "done": "all trials are done",
        "over": "the collection has ended",
    }[guide.stage]


def _counted(names: Sequence[str], values: Sequence[bool | None], what: str) -> str:
    """Return a sentence on how many of the inputs that can be read are so, "" without any; values end where nothing is
    read.
    """
    lost = [name for place, name in enumerate(names) if place >= len(values) or values[place] is None]
    count = sum(map(bool, values))
    if lost:
        return f"{count} of {len(names) - len(lost)} readable {what}; {len(lost)} lost ({list_names(lost)})"
    return f"{count} of {len(names)} {what}" if names else ""


def _letters(frame: SwitchFrame, switches: int) -> str:
    return "".join(
        "x" if frame.lost >> number & 1 else "1" if frame.closed >> number & 1 else "0" for number in range(switches)
    )


def pose_page(address: str, *, token: str | None, names: Sequence[str], subject: str) -> GuidePage:
    """Return the page of a calibration of the sensors called `names`, of a subject."""
    leave = "Leave? Nothing is written; an older calibration stays as it is."
    about = {"what": "Calibration of", "subject": subject, "leave": leave, "table": names, "study": False}
    return GuidePage(address, token=token, keys=POSE_KEYS, view=_pose_view, about=about, hands={"pose": posed_hand()})


_POSE_SAYS: dict[PoseStage, str] = {
    "ready": "hold this pose, then press Enter",
    "held": "hold still",
    "doubted": "this pose is in doubt",
    "done": "all poses are taken",
    "over": "the calibration has ended",
}


def _pose_view(now_us: int, guide: PoseGuide) -> dict[str, object]:
    """Return the view of a calibration."""
    pose, total, silent = guide.pose, len(guide.poses), guide.silent(now_us)
    done, first = guide.stage in ("done", "over"), not guide.taken
    raw: Sequence[int | None] = [*guide.raw] if guide.raw else [None] * len(guide.names)
    states = guide.states() or [""] * len(guide.names)
    rows = []
    for place, name in enumerate(guide.names):
        concerned, state = first or name in pose.degrees, states[place]
        rows.append(
            {
                "byte": raw[place],
                "flat": None if first else guide.taken[0].raw[place],
                "state": state or "this pose's" * concerned,
                "concerned": concerned,
                "faulty": bool(state),
            }
        )
    faulty = sum(map(bool, states))
    sees = f"{faulty} of {len(rows)} sensors: see State" if faulty else f"all {len(rows)} sensors are measured"
    waits = guide.stage == "ready" and silent
    return {
        "count": f"{total} of {total} poses taken" if done else f"pose {len(guide.taken) + 1} of {total}",
        "done": len(guide.taken),
        "total": total,
        "title": "All poses are taken" if done else pose.name,
        "detail": "" if done else pose.instruction,
        "pose": None if done else posed({**_FURTHER.get(pose.name, {}), **pose.degrees}),
        "says": "the glove is silent: no pose can be taken until it sends" if waits else _POSE_SAYS[guide.stage],
        "number": "",
        "problems": guide.problems if guide.stage == "doubted" else [],
        "offered": guide.offered(now_us),
        "time_us": guide.raw_us,
        "age_us": guide.raw_us and now_us - guide.raw_us,
        "devices": (),
        "rows": rows,
        "sees": _counted(guide.names, (), "sensors measured") if silent or not guide.raw else sees,
    }
