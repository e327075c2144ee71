"""The live page of a run: its view of each moment.

In the loop of the run a moment costs a reference or two; its text is made on the server's thread, if a page is open.
"""

from collections import deque
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import msgspec

from ..build import Build
from ..frames import now_us
from ..glove import Glove
from ..hand import load_hand
from ..harness.wiring import Harness
from ..live.recogniser import Moment
from ..manifest import Manifest
from ..published import HealthReport, LiveGrasp
from ..scores import softmax
from ..taxels import calibration_of
from .server import Server, message

# Length of the past that a page shows, and more changes of the prediction than usually come in it.
PAST_US, _MOST_CHANGES = 30_000_000, 6_000
# A prediction's time, candidate, grasp, health, state, and its segment's number, type and beginning.
Change = tuple[int, str, str, str, str, int, str, int | None]
_encode = msgspec.json.Encoder().encode
_FRAME = b'{"topic":"frame",'


class LivePage:
    """Shows a glove on the page of a server.

    Parameters
    ----------
    server : Server
        The server, on which the topics "build", "hand", "past", "frame" and "health" are published.
    glove : Glove
        The running glove.
    folder : Path
        The build's folder, whose hand is drawn.

    Raises
    ------
    BuildError
        If the build's drawing of a hand is damaged.
    """

    def __init__(self, server: Server, glove: Glove, folder: Path) -> None:
        self.server, self._glove = server, glove
        self._frames = FrameText(glove.system.build, glove.system.harness)
        self._health: HealthReport | None = None
        # The latest changes of the prediction, for pages opened later.
        self._past, self._until_us = deque[Change](maxlen=_MOST_CHANGES), 0
        manifest = glove.system.build.manifest
        server.publish("build", build_message(manifest, preshapes=glove.has_preshapes))
        server.publish("hand", message("hand", load_hand(folder, manifest)))
        server.publish("past", self._past_message)

    def show(self, moment: Moment) -> None:
        """Show the moment that the glove has just published. For the thread of the run."""
        grasp, glove = moment.grasp, self._glove
        self.server.publish("frame", partial(self._frames, moment))
        self._until_us, change = grasp.time_us, change_of(grasp)
        if not self._past or change[1:] != self._past[-1][1:]:
            self._past.append(change)
        if glove.health is not self._health and glove.health is not None:
            self._health = glove.health
            self.server.publish("health", partial(message, "health", self._health))

    def _past_message(self) -> bytes:
        return message("past", changes=list(self._past.copy()), until_us=self._until_us)


def change_of(grasp: LiveGrasp) -> Change:
    """Return a prediction as pages keep it, its time first: they show where the rest changes."""
    now = grasp.candidate, grasp.grasp, grasp.health, grasp.state, grasp.segment, grasp.segment_type
    return (grasp.time_us, *now, grasp.segment_us)


def shell_message(
    project: str,
    folder: Path | None = None,
    manifest: Manifest | None = None,
    *,
    pages: Sequence[tuple[str, str]] = (),
    wearer: str = "",
) -> bytes:
    """Return the message on the bar of all pages: the project's name, the build in a folder, the accuracy that it
    states, the wearer, and the files and titles of the pages.
    """
    build = rate = ""
    if folder is not None and manifest is not None:
        build = f"{folder.resolve().name} {manifest.checksum[:8]}"
        stated = min(manifest.rates, key=lambda rate: rate.protocol == "training")
        ends = (
            "" if stated.low is None or stated.high is None else f" [{100 * stated.low:.1f}, {100 * stated.high:.1f}]"
        )
        rate = f"{100 * stated.rate:.1f}{ends} % {stated.title}"
    return message("shell", project=project, build=build, rate=rate, pages=pages, wearer=wearer)


def build_message(manifest: Manifest, **shows: bool) -> bytes:
    """Return the message on a build: its types, switches and joints; whether it knows an empty hand; and what else the
    page `shows`: "preshapes" or a "replay".
    """
    known = {
        "grasps": manifest.classes,
        "switches": [switch.name for switch in manifest.switches],
        "joints": [joint.name for joint in manifest.joints],
        "empty_hand": manifest.knows_none,
    }
    return message("build", known, **{"preshapes": False, "replay": False} | shows)


class FrameText:
    """Makes the text of a moment of a run of `build`: the fields of its grasp, preshape and angles as in sinks, and

    late_us        its age now
    closed         a character per kept switch, in the build's order: "1" closed, "0" open
    joints         the value of each joint of the build, in its unit; None while they are lost
    probabilities  of every class of the build, in order; None while too little can be read
    taxels         by name, how far each read and calibrated taxel is pressed, from 0 at rest to 1 at its press
    """

    def __init__(self, build: Build, harness: Harness) -> None:
        self._switches, self._scale = build.tables.n_switches, build.tables.scale
        self._none_leads = None if build.rejector is None else build.none_leads
        self._joints = build.manifest.joints
        calibration = calibration_of(harness.taxel_settings)
        self._taxels = [None if calibration is None else calibration.line(name) for name in harness.taxel_names]

    def __call__(self, moment: Moment) -> bytes:
        """Return the text."""
        frame, codes, shut = moment.switches, moment.codes, ""
        if self._switches:
            shut = f"{0 if frame is None else frame.closed:0{self._switches}b}"[::-1]
        more = {
            "preshape": moment.preshape,
            "angles": moment.angles,
            "late_us": now_us() - moment.grasp.time_us,
            "closed": shut,
            "joints": None
            if codes is None
            else [round(joint.value(code), 2) for joint, code in zip(self._joints, codes, strict=True)],
            "probabilities": self._probabilities(moment.scores, moment.refused) if moment.scores else None,
            "taxels": {} if frame is None or frame.taxels is None else self._pressed(frame.taxels),
        }
        # Both are objects of JSON: their fields follow the topic.
        return _FRAME + _encode(moment.grasp)[1:-1] + b"," + _encode(more)[1:]

    def _probabilities(self, scores: Sequence[int], refused: bool) -> tuple[float, ...]:
        if self._none_leads is not None:
            scores = (*scores, max(scores) + self._none_leads[refused])
        return tuple(round(share, 4) for share in softmax(scores, self._scale))

    def _pressed(self, codes: Sequence[int | None]) -> dict[str, float]:
        return {
            line.name: round(min(max((code - line.rest) / (line.press - line.rest), 0.0), 1.0), 3)
            for code, line in zip(codes, self._taxels, strict=True)
            if code is not None and line is not None
        }
