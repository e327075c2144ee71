"""The page of a guided calibration: the pose to hold, each sensor's byte live, and the keys pressed there."""

from collections.abc import Mapping

from thenar.drivers.closing import Closing

from ..posing import PoseGuide, PoseKey, PoseStage
from .presses import Presses
from .server import Server, message

_PERIOD_US = 50_000


class PosePage(Closing):
    """Serves the page of a calibration until it is left; a context manager.

    Parameters
    ----------
    address, token
        As for `Server`.
    guide : PoseGuide
        The guide that it shows.
    hand : object
        The drawing on which hand.js shows a pose.
    pictures : mapping
        The values of that drawing's joints, by the name of the pose.

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
        guide: PoseGuide,
        hand: object,
        pictures: Mapping[str, object],
        subject: str,
    ) -> None:
        self._guide, self._pictures = guide, pictures
        self._presses = Presses(PoseKey)
        self._due_us, self._step = 0, -1
        first = (message("sensors", names=guide.names, subject=subject), message("hand", hand))
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
                picture=self._pictures.get(pose.name),
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
