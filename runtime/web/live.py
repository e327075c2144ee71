"""The live page of a run: its view of each moment.

In the loop of the run a moment costs a reference or two; its text is made on the server's thread, if a page is open.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from time import localtime, strftime, time, time_ns

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

# Changes that a page opened later gets: ten minutes of a hand that is never still.
_MOST_CHANGES = 6_000
# A moment is current for half a second, or for three periods of its source.
_SILENT_US, _PERIODS = 500_000, 3
# A clock that differs by more was set: to a later time, or back, where the past begins anew.
_SET_US = 1_000_000
# What is said of the glove is repeated once a second, and is not known when it was not.
_LASTS_S = 3
# What a timeline shows of a prediction: its time since 1970, the announced type, "degraded" or "unknown" health, and
# the type and the beginning of the segment.
Change = tuple[int, str, str, str, int | None]
_encode = msgspec.json.Encoder().encode
_FRAME = b'{"topic":"frame",'


class LivePage:
    """Shows a glove on the page of a server.

    Parameters
    ----------
    server : Server
        The server, on which the topics "build", "past", "frame", "health" and "glove" are published.
    glove : Glove
        The running glove.
    folder : Path
        The build's folder, whose hand is drawn.
    after : LivePage, optional
        The page of a run that this one continues: its past stays.

    Raises
    ------
    BuildError
        If the build's drawing of a hand is damaged.
    """

    def __init__(self, server: Server, glove: Glove, folder: Path, after: "LivePage | None" = None) -> None:
        self.server, self._glove = server, glove
        # Where the monotonic clock of moments began, since 1970.
        self._clock_us = time_ns() // 1000 - now_us()
        self._frames = FrameText(glove.system.build, glove.system.harness)
        self._health: HealthReport | None = None
        # For pages opened later.
        self._past: Past = Past() if after is None else after._past
        self._past.silent_us = silent_us(glove.sources.switch_period_us, glove.sources.glove_period_us)
        # The devices that are lost, and since when; and when the newest data was read.
        self._lost = dict[str, str]()
        self._read_us: int | None = None
        manifest, silent = glove.system.build.manifest, self._past.silent_us
        about = build_message("build", folder, manifest, silent_us=silent, preshapes=glove.has_preshapes)
        server.publish("build", about)
        server.publish("past", self._past_message)

    def show(self, moment: Moment) -> None:
        """Show the moment that the glove has just published. For the thread of the run."""
        grasp = moment.grasp
        set_by_us = grasp.unix_us - grasp.time_us - self._clock_us
        if abs(set_by_us) > _SET_US:
            self._clock_us += set_by_us
            if set_by_us < 0:
                self._past.changes, self._past.until_us = [], 0
        self.server.publish("frame", partial(self._frames, moment, self._clock_us))
        self._past.take(change_of(grasp, self._clock_us))
        del self._past.changes[:-_MOST_CHANGES]
        ages_us = [age for age in (grasp.switch_age_us, grasp.glove_age_us) if age is not None]
        if ages_us:
            self._read_us = grasp.time_us - min(ages_us)
        health, known = self._glove.health, self._health
        if health is not None and health is not known:
            gone = [device.name for device in health.devices if not device.connected]
            state = "not connected" if known is None else f"lost since {_clock(0)}"
            self._health, self._lost = health, {name: self._lost.get(name, state) for name in gone}
            self.server.publish("health", partial(message, "health", health))
            self.server.publish("glove", self._glove_message)

    def _glove_message(self) -> bytes:
        """Return the message on how the glove is now, "good", "warn" or "bad", and in words."""
        level, words = "good", "connected"
        ended = self._clock_us + now_us() - self._past.until_us > 1_000_000 * _LASTS_S
        if self._lost and not ended:
            level, words = "bad", ", ".join(f"{name} {state}" for name, state in self._lost.items())
        elif self._read_us is None:
            level, words = "warn", "sends nothing yet"
        elif (ago_us := now_us() - self._read_us) > self._past.silent_us:
            level, words = "bad", f"silent since {_clock(ago_us)}"
        return message("glove", {"is": level}, words=words, lasts_s=_LASTS_S)

    def _past_message(self) -> bytes:
        return message("past", changes=[*self._past.changes], until_us=self._past.until_us)


def _clock(ago_us: int) -> str:
    """Return the time of day: "10:24:07"."""
    return strftime("%H:%M:%S", localtime(time() - ago_us / 1e6))


class Past:
    """The changes of a build's prediction, in the order of their times, and until when they are all."""

    def __init__(self, silent_us: int = _SILENT_US) -> None:
        self.changes, self.until_us, self.silent_us = list[Change](), 0, silent_us

    def take(self, change: Change) -> bool:
        """Take the next moment's, and return whether it differs from the last; after a silence nothing is known."""
        time_us, *shown = change
        if self.changes and time_us - self.until_us > self.silent_us:
            self.changes.append((self.until_us, "", "", "", None))
        self.until_us = max(self.until_us, time_us)
        # Clocks of two sessions of a recording may overlap.
        if self.changes and (shown == list(self.changes[-1][1:]) or time_us < self.changes[-1][0]):
            return False
        self.changes.append(change)
        return True


def silent_us(*periods_us: int | None) -> int:
    """Return how long a moment is current that rests on sources of these periods."""
    return max(_SILENT_US, *(_PERIODS * (period or 0) for period in periods_us))


def change_of(grasp: LiveGrasp, clock_us: int) -> Change:
    """Return a prediction as timelines show it; its clock began at `clock_us`. A segment that forms may be revoked."""
    began_us = grasp.segment_us if grasp.state in ("held", "releasing") else None
    health = grasp.health if grasp.health in ("degraded", "unknown") else ""
    segment = ("", None) if began_us is None else (grasp.segment_type, began_us + clock_us)
    return grasp.time_us + clock_us, grasp.grasp, health, *segment


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


def build_message(topic: str, folder: Path, manifest: Manifest, *, silent_us: int | None, **shows: object) -> bytes:
    """Return a message on the build in a folder: its name, types and switches, whether it knows an empty hand, the
    drawing of the hand, how long a moment of its run is current, or None for a recording, and what else the page
    `shows`. Raises BuildError if the drawing is damaged.
    """
    known = {
        "silent_us": silent_us,
        "name": folder.resolve().name,
        "grasps": manifest.classes,
        "switches": [switch.name for switch in manifest.switches],
        "empty_hand": manifest.knows_none,
        "hand": load_hand(folder, manifest),
    }
    return message(topic, known, **shows)


class FrameText:
    """Makes the text of a moment of a run of `build`: the fields of its grasp as in sinks, and

    change         as timelines show it, with times since 1970
    late_us        its age now
    preshape       the name of what the robot's hand should do now, or None
    closed         a character per kept switch, in the build's order: "1" closed, "0" open
    joints         the value of each joint of the build, in its unit; None while they are lost
    probabilities  of every class of the build, in order; None while too little can be read
    taxels         by name, how far each read and calibrated taxel is pressed, from 0 at rest to 1 at its press
    """

    def __init__(self, build: Build, harness: Harness) -> None:
        self._switches, self._scale = build.tables.n_switches, build.tables.scale
        self._none_leads = None if build.scorer.rejector is None else build.scorer.none_leads
        self._joints = build.manifest.joints
        calibration = calibration_of(harness.taxel_settings)
        self._taxels = [None if calibration is None else calibration.line(name) for name in harness.taxel_names]

    def __call__(self, moment: Moment, clock_us: int) -> bytes:
        """Return the text of a moment whose clock began at `clock_us`."""
        frame, codes, shut = moment.switches, moment.codes, ""
        if self._switches:
            shut = f"{0 if frame is None else frame.closed:0{self._switches}b}"[::-1]
        more = {
            "preshape": moment.preshape and moment.preshape.name,
            "change": change_of(moment.grasp, clock_us),
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
            line.name: round(min(max((code - line.raw_a) / (line.raw_b - line.raw_a), 0.0), 1.0), 3)
            for code, line in zip(codes, self._taxels, strict=True)
            if code is not None and line is not None
        }
