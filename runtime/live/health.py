"""How the glove fares: what `thenar run --status` shows and what is published beside the grasps."""

from collections import Counter
from collections.abc import Sequence

import msgspec

from ..build import Build
from .drift import JointDrift
from .frames import SwitchFrame
from .published import UNKNOWN, LiveGrasp
from .rates import Chattering, FrameRate
from .stuck import StuckSwitches


class Count(msgspec.Struct, frozen=True):
    """How often something happened: CRC errors, resynchronisations, frames lost."""

    name: str
    value: int


class DeviceHealth(msgspec.Struct, frozen=True):
    """A device: whether it is there, what is or was wrong last, and what its driver counts."""

    name: str
    connected: bool
    error: str = ""
    counts: tuple[Count, ...] = ()


class Drift(msgspec.Struct, frozen=True):
    """By how many codes a joint has drifted."""

    joint: str
    codes: int


class HealthReport(msgspec.Struct, frozen=True):
    """State at `time_us` of the host's monotonic clock.

    stuck_open, stuck_closed   switches that should have been seen closed, or open, by now (stuck.py)
    chattering                 switches that changed more often in the last second than a hand can (rates.py)
    drifting                   joints whose codes have moved since the first minute (drift.py)
    switch_hz, glove_hz        frames per second over the last whole second
    frames, changing, degraded, unknown  how many grasps were published so far, and how many of them with that health
    overflowed                 frames that came in and were not taken in time: a recording lacks them
    devices                    as their drivers have it
    """

    time_us: int
    stuck_open: tuple[str, ...]
    stuck_closed: tuple[str, ...]
    chattering: tuple[str, ...]
    drifting: tuple[Drift, ...]
    switch_hz: float
    glove_hz: float
    frames: int
    changing: int
    degraded: int
    unknown: int
    overflowed: int = 0
    devices: tuple[DeviceHealth, ...] = ()


class Health:
    """Watches frames and grasps go by; nothing that it finds changes an answer."""

    def __init__(self, build: Build) -> None:
        self._switch_names = tuple(switch.name for switch in build.manifest.switches)
        self._joint_names = tuple(joint.name for joint in build.manifest.joints)
        self._numbers = {grasp: number for number, grasp in enumerate(build.grasps)}
        self._all = (1 << len(self._switch_names)) - 1
        self._stuck, self._drift = StuckSwitches(build.tables), JointDrift()
        self._chattering = Chattering(len(self._switch_names))
        self._switch_rate, self._glove_rate = FrameRate(), FrameRate()
        self._grasp = UNKNOWN
        self._switches_us = self._glove_us = -1
        self._published = Counter[str]()

    def update(
        self,
        grasp: LiveGrasp,
        switches: SwitchFrame | None,
        glove_us: int | None = None,
        codes: Sequence[int] | None = None,
    ) -> None:
        """Take what was published, and the frames that it came of; a frame that was seen before counts once.

        glove_us is the time of the glove's frame, codes are its joints' (`LiveRecognizer.codes`), None while lost.
        """
        self._published[grasp.health] += 1
        if grasp.grasp != self._grasp:
            self._stuck.end_grasp(self._numbers.get(self._grasp))
            self._grasp = grasp.grasp
        if switches is not None and switches.time_us > self._switches_us:
            self._switches_us = switches.time_us
            self._take(switches)
        if glove_us is not None and glove_us > self._glove_us:
            self._glove_us = glove_us
            self._glove_rate.frame(glove_us)
            if codes:
                self._drift.frame(glove_us, codes)

    def report(self, now_us: int, devices: Sequence[DeviceHealth] = (), overflowed: int = 0) -> HealthReport:
        """Return how things stand."""
        drifts = zip(self._joint_names, self._drift.codes, strict=False)
        return HealthReport(
            time_us=now_us,
            stuck_open=self._named(self._stuck.open()),
            stuck_closed=self._named(self._stuck.closed()),
            chattering=self._named(self._chattering.switches),
            drifting=tuple(Drift(joint, codes) for joint, codes in drifts if codes),
            switch_hz=self._switch_rate.hz(now_us),
            glove_hz=self._glove_rate.hz(now_us),
            frames=self._published.total(),
            changing=self._published["changing"],
            degraded=self._published["degraded"],
            unknown=self._published["unknown"],
            overflowed=overflowed,
            devices=tuple(devices),
        )

    def _take(self, frame: SwitchFrame) -> None:
        read = self._all & ~(frame.lost | frame.unread)
        self._switch_rate.frame(frame.time_us)
        self._stuck.frame(frame.closed, read)
        self._chattering.frame(frame.time_us, frame.closed, read)

    def _named(self, switches: Sequence[int]) -> tuple[str, ...]:
        return tuple(self._switch_names[number] for number in switches)
