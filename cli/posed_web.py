"""`thenar calibrate --web`: the page of the poses."""

from collections.abc import Callable
from typing import Protocol

import click

from thenar.drivers.calibration import FLAT, POSES
from thenar.drivers.cyberglove_protocol import SENSORS_22
from thenar.runtime.frames import now_us
from thenar.runtime.hand import HandDrawing, drawn_joints
from thenar.runtime.manifest import Calibration
from thenar.runtime.posing import PoseGuide, PoseStage
from thenar.runtime.web.posed import PosePage

from .common import err
from .ending import ended_by_signals
from .web_options import say_page


class Sensors(Protocol):
    """A glove's description of itself."""

    @property
    def names(self) -> tuple[str, ...]:
        """Its sensors, in wire order."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Its oddities, in sentences."""


def calibrate_on_page(
    read: Callable[[], bytes | None],
    info: Sensors,
    hold_s: float,
    old_us: int,
    subject: str,
    address: str,
    token: str | None,
    written: Callable[[PoseGuide], str],
) -> str:
    """Lead through the poses on a page; call `written` when all are taken, and return its result.

    Raises click.Abort if the user leaves, SettingError or SinkError if the page cannot be served, and the errors of
    `read` and `written`.
    """
    for note in info.notes:
        err().print(note, soft_wrap=True)
    guide = PoseGuide(info.names, round(hold_s * 1e6), old_us)
    hand, pictures = drawn_poses()
    page = PosePage(address, token=token, guide=guide, hand=hand, pictures=pictures, subject=subject)
    with ended_by_signals() as stop, page:
        say_page(page.url)
        try:
            while guide.stage is not PoseStage.OVER and not stop.is_set():
                raw = read()
                if raw is not None:
                    guide.take(now_us(), raw)
                page.step(now_us())
            if guide.left or stop.is_set():
                raise click.Abort
            said = written(guide)
        except click.Abort:
            page.say("left; nothing is written")
            raise
        except Exception as fault:
            page.say(str(fault))
            raise
        page.say(said)
    return said


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


def drawn_poses() -> tuple[HandDrawing, dict[str, list[float]]]:
    """Return a hand with the joints of a CyberGlove with 22 sensors, and their angles in each pose."""
    joints = [Calibration(at, name, "deg", 0, 0.0, 90, 90.0) for at, name in enumerate(SENSORS_22)]
    hand = HandDrawing(view="", placed=False, radius_mm=1.0, switches=(), taxels=(), joints=drawn_joints(joints))
    pictures = {}
    for pose in (FLAT, *POSES):
        angles = {**_RELAXED, **_BESIDES.get(pose.name, {}), **pose.degrees}
        pictures[pose.name] = [angles.get(name, 0.0) for name in SENSORS_22]
    return hand, pictures
