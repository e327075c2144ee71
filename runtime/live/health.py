"""The glove's health: shown by `thenar run --status` and published with the grasps.

Switches that are never, or always, closed are compared with how often they were closed in the training recordings.

The build holds that share. A held grasp is one observation, however many frames it lasts. If a switch is closed in a
share p of grasps, it stays open throughout n of them with a probability of at most (1 - p)^n, and closed with at most
p^n, given that grasps are distributed as in the recordings. Because people also repeat one grasp for long, a switch is
only suspected once half of the grasp types were seen since its other state was last seen.

The quarantine (quarantine.py) finds faults from all other inputs and leaves those inputs out of the prediction; which
inputs chatter and drift is known from it.
"""

import math
from collections import Counter
from collections.abc import Sequence

from ..build import Build
from ..frames import Mask, SwitchFrame
from ..published import UNKNOWN, DeviceHealth, Drift, HealthReport, LiveGrasp, OutputTrouble, Quarantined
from .quarantine import Quarantine, numbers

RATE_US = 1_000_000
# How improbable the observation must be for a working switch.
ALARM = 1e-4
_SURE = 1 - 1e-12


class Health:
    """Observes frames and grasps; its findings change no prediction. `quarantine` is that of the recogniser."""

    def __init__(self, build: Build, quarantine: Quarantine) -> None:
        self._switch_names = tuple(switch.name for switch in build.manifest.switches)
        self._joint_names = tuple(joint.name for joint in build.manifest.joints)
        self._numbers = {grasp: number for number, grasp in enumerate(build.grasps)}
        self._all = (1 << len(self._switch_names)) - 1
        shares, classes = on_shares(build), build.tables.n_classes
        self._never_closed, self._never_open = Missed(shares, classes), Missed([1 - share for share in shares], classes)
        self._read: Mask = 0  # during the current grasp
        self._quarantine = quarantine
        self._switch_rate, self._glove_rate = FrameRate(), FrameRate()
        self._grasp = UNKNOWN
        self._switches_us = self._glove_us = -1
        self._published = Counter[str]()

    def update(
        self,
        grasp: LiveGrasp,
        switches: SwitchFrame | None,
        glove_us: int | None = None,
    ) -> None:
        """Take a published grasp, the frame of switches behind it, and the time of the glove's; a frame that was seen
        before counts once.
        """
        self._published[grasp.health] += 1
        if grasp.grasp != self._grasp:
            self._end_grasp(self._numbers.get(self._grasp))
            self._grasp = grasp.grasp
        if switches is not None and switches.time_us > self._switches_us:
            self._switches_us = switches.time_us
            read = self._all & ~switches.lost
            self._switch_rate.frame(switches.time_us)
            self._read |= read
            self._never_closed.seen |= switches.closed & read
            self._never_open.seen |= ~switches.closed & read
        if glove_us is not None and glove_us > self._glove_us:
            self._glove_us = glove_us
            self._glove_rate.frame(glove_us)

    def report(
        self,
        now_us: int,
        devices: Sequence[DeviceHealth] = (),
        overflowed: int = 0,
        quarantined: tuple[Quarantined, ...] = (),
        outputs: tuple[OutputTrouble, ...] = (),
    ) -> HealthReport:
        """Return the current health."""
        drifts = zip(self._joint_names, self._quarantine.drift.codes, strict=False)
        return HealthReport(
            time_us=now_us,
            stuck_open=self._named(self._never_closed.suspects()),
            stuck_closed=self._named(self._never_open.suspects()),
            chattering=self._named(numbers(self._quarantine.chattering.switches)),
            drifting=tuple(Drift(joint, codes) for joint, codes in drifts if codes),
            switch_hz=self._switch_rate.hz(now_us),
            glove_hz=self._glove_rate.hz(now_us),
            frames=self._published.total(),
            changing=self._published["changing"],
            degraded=self._published["degraded"],
            unknown=self._published["unknown"],
            overflowed=overflowed,
            devices=tuple(devices),
            quarantined=quarantined,
            outputs=outputs,
        )

    def _end_grasp(self, number: int | None) -> None:
        """End a grasp of type `number`; None: it was none, and its observations count for the next."""
        if number is not None:
            self._never_closed.end_grasp(number, self._read)
            self._never_open.end_grasp(number, self._read)
            self._read = 0

    def _named(self, switches: Sequence[int]) -> tuple[str, ...]:
        return tuple(self._switch_names[number] for number in switches)


class FrameRate:
    """Frames per second over the last second."""

    def __init__(self) -> None:
        self._began_us: int | None = None
        self._frames = 0
        self._hz = 0.0

    def frame(self, time_us: int) -> None:
        """Count a frame."""
        if self._began_us is None:
            self._began_us = time_us
            return
        self._frames += 1
        if time_us - self._began_us >= RATE_US:
            self._hz = self._over(time_us)
            self._began_us, self._frames = time_us, 0

    def hz(self, now_us: int) -> float:
        """Return the rate of the last whole second, or of the time since the last frames, if none come."""
        if self._began_us is not None and now_us - self._began_us > 2 * RATE_US:
            return self._over(now_us)
        return self._hz

    def _over(self, now_us: int) -> float:
        return self._frames * 1e6 / (now_us - (self._began_us or 0))


def on_shares(build: Build) -> list[float]:
    """Return, for every switch, the share of the recordings in which it was closed; nan if unknown."""
    shares = (switch.closed_share for switch in build.manifest.switches)
    return [math.nan if share is None else share for share in shares]


def patience(share: float) -> float:
    """Return the number of grasps without an event after which an event of this `share` is suspiciously missing."""
    if math.isnan(share) or share <= 0:
        return math.inf
    return math.ceil(math.log(ALARM) / math.log1p(-min(share, _SURE)))


class Missed:
    """Counts, for every switch, the grasps since an event of it: that it was closed, or that it was open."""

    def __init__(self, shares: Sequence[float], classes: int) -> None:
        self._patience = [patience(share) for share in shares]
        self._enough = classes / 2
        self._grasps = [0] * len(shares)
        self._types = [0] * len(shares)
        self.seen: Mask = 0

    def end_grasp(self, number: int, read: Mask) -> None:
        """Count a grasp of type `number` that is over; `read` are the switches that were read during it."""
        for switch in range(len(self._grasps)):
            if self.seen >> switch & 1:
                self._grasps[switch] = self._types[switch] = 0
            elif read >> switch & 1:
                self._grasps[switch] += 1
                self._types[switch] |= 1 << number
        self.seen = 0

    def suspects(self) -> list[int]:
        """Return the switches whose event should have been seen by now."""
        return [
            switch
            for switch, (grasps, types) in enumerate(zip(self._grasps, self._types, strict=True))
            if grasps >= self._patience[switch] and types.bit_count() >= self._enough
        ]
