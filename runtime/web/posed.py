"""The page of a guided calibration: the pose to hold, each sensor's byte live, and the keys pressed there."""

from collections.abc import Mapping

from thenar.drivers.closing import Closing
from thenar.drivers.cyberglove_protocol import SENSORS_22

from ..hand import HandDrawing, drawn_joints
from ..manifest import Calibration
from ..posing import PoseGuide, PoseKey, PoseStage
from .presses import Presses
from .server import Server, message

_PERIOD_US = 50_000

# The pose in which hand.js draws an idle hand, and further angles that a pose needs to be recognisable, in degrees.
_RELAXED = {
    "thumb_rotation": 20.0,
    "thumb_abduction": 25.0,
    "middle_index_abduction": 5.0,
    "ring_middle_abduction": 5.0,
    "little_ring_abduction": 6.0,
}
_BESIDES = {
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


class PosePage(Closing):
    """Serves the page of a calibration until it is left; a context manager.

    Parameters
    ----------
    address, token
        As for `Server`.
    guide : PoseGuide
        The guide that it shows.
    subject : str
        Whose hand it is.

    Raises
    ------
    SettingError, SinkError
        As `Server` does.
    """

    def __init__(self, address: str, *, token: str | None, guide: PoseGuide, subject: str) -> None:
        self._guide = guide
        self._presses = Presses(PoseKey)
        self._due_us, self._step = 0, -1
        first = (message("sensors", names=guide.names, subject=subject), message("hand", posed_hand()))
        self._server = Server("calibrate", address, token=token, on_message=self._presses.take, hello=lambda: first)
        self.url = self._server.url

    def step(self, now_us: int) -> None:
        """Pass the pressed keys to the guide, and show the guide's state if it changed or the next refresh is due."""
        guide = self._guide
        for key in self._presses.due(lambda: guide.step):
            guide.press(now_us, key)
        if now_us < self._due_us and guide.step == self._step:
            return
        self._due_us, self._step = now_us + _PERIOD_US, guide.step
        pose = guide.pose
        first = not guide.taken
        self._server.publish(
            "pose",
            message(
                "pose",
                step=guide.step,
                stage=guide.stage.value,
                number=min(len(guide.taken) + 1, len(guide.poses)),
                total=len(guide.poses),
                name=pose.name,
                instruction=pose.instruction,
                picture=posed({**_BESIDES.get(pose.name, {}), **pose.degrees}),
                left_s=guide.seconds_left(now_us),
                problems=guide.problems if guide.stage is PoseStage.DOUBTED else [],
                offered={key.value: what for key, what in guide.offered(now_us).items()},
                time_us=guide.raw_us,
                age_us=guide.raw_us and now_us - guide.raw_us,
                silent=guide.silent(now_us),
                bytes=[*(guide.raw or b"")],
                flat=None if first else [*guide.taken[0].raw],
                concerned=[first or name in pose.degrees for name in guide.names],
                states=guide.states(),
            ),
        )

    def say(self, sentence: str) -> None:
        """Show how the calibration ended."""
        self._server.publish("end", message("end", text=sentence))

    def close(self) -> None:
        """Close the page, once it shows the last message."""
        self._server.close()
