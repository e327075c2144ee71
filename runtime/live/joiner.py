"""The live recogniser: the newest frame of each device, joined, scored, decided upon."""

from collections.abc import Sequence
from typing import Protocol

from thenar.drivers.calibration import GloveCalibration

from ..build import Build
from ..scanning.earlyexit import EarlyExit
from ..scanning.reach import Reach
from .codes import CodeTables
from .decision import Decision
from .frames import GloveFrame, Mask, SwitchFrame
from .missing import Missing, MissingInputs
from .newest import Newest
from .policy import Policy
from .published import UNKNOWN, Health, LiveGrasp
from .scores import LiveScores
from .sequential import SequentialTest
from .standing import Standing


class Decider(Protocol):
    """What turns frames into a grasp type: `Decision` or `SequentialTest`."""

    def update(self, time_us: int, standing: Standing, *, whole: bool) -> int | None:
        """Return the class decided on. After a whole frame, one with no input lost, it rests on whole frames alone."""

    def forget(self) -> None:
        """Decide on nothing."""


class LiveRecognizer:
    """Joins switches and CyberGlove and says what they show, whatever of them is there.

    A frame counts for two of its periods. What is older, or lost, or of a glove that is not plugged into its box, is
    replaced by its mean contribution, and the answer is degraded; it is unknown when the share of the tables' weight
    that is lost exceeds `policy.max_lost`, and when nothing is left that the build uses. A device whose kind the build
    does not use is left aside. The answer depends on nothing but the frames handed over and their times, so a replay of
    the same calls gives the same answers.
    """

    def __init__(
        self,
        build: Build,
        *,
        sensor_names: Sequence[str] = (),
        calibration: GloveCalibration | None = None,
        switch_period_us: int | None = None,
        glove_period_us: int | None = None,
        policy: Policy | None = None,
    ) -> None:
        """Take the names of the CyberGlove's sensors in wire order, and periods; None: there is no such device.

        Raises SettingError if the CyberGlove cannot serve the build.
        """
        self._build, self._policy = build, policy or Policy()
        tables = build.tables
        joints = build.manifest.joints if glove_period_us is not None else ()
        self._all_switches: Mask = (1 << tables.n_switches) - 1
        self._codes = CodeTables(joints, sensor_names, calibration)
        self._switches = Newest[SwitchFrame](switch_period_us if tables.n_switches else None)
        self._glove = Newest[GloveFrame](glove_period_us if tables.n_joints else None)
        self._scores, self._reach = LiveScores(tables), Reach(tables)
        self._missing = MissingInputs(build, self._policy.max_lost)
        self._decider, self._lead = _decider(build, self._policy), self._policy.lead_steps(tables.scale)
        self._number = 0

    def early_exit(self, ports: Sequence[Mask]) -> EarlyExit | None:
        """Return what ends a scan of `ports` early without changing any decision; None: frames must be whole.

        Hand `start` the `codes` of the glove frame that `step` will be given with the scan.
        """
        if self._policy.error_rate is not None:
            return None
        return EarlyExit(self._build.tables, ports, lead=self._lead)

    def codes(self, now_us: int, glove: GloveFrame | None) -> list[int] | None:
        """Take a glove frame, as `step` does; return the joints' codes, None while they are lost. Raises FrameError."""
        self._glove.take(glove, now_us)
        if not self._build.tables.n_joints:
            return []
        frame = self._glove.fresh(now_us)
        return None if frame is None or not frame.plugged else self._codes.codes(frame.sensors)

    def step(self, now_us: int, unix_us: int, switches: SwitchFrame | None, glove: GloveFrame | None) -> LiveGrasp:
        """Return what is recognised at `now_us`, given what came in since the last step (None: nothing).

        The same frame may be handed over again: it grows no younger. Raises FrameError for a frame of another glove.
        """
        self._switches.take(switches, now_us)
        frame = self._switches.fresh(now_us)
        # Ports that were left unread are certain only with the joints by which their scan ended; and a frame that was
        # handed over once stays the newest, so every scan that can end early brings the joints' frame along.
        codes = self.codes(now_us, glove if frame is None or frame.glove is None else frame.glove)
        lost = self._all_switches if frame is None else frame.lost
        self._scores.joints(codes)
        standing, lost = self._standing(frame, lost)
        missing = self._missing.of(lost, codes is None)
        decided = self._decide(standing, missing)
        return self._published(now_us, unix_us, standing, missing, decided)

    def _standing(self, frame: SwitchFrame | None, lost: Mask) -> tuple[Standing, Mask]:
        """Return who stands where, and what is lost: unread switches are, unless the candidate is certain without them.

        They always are certain where the scan was ended by `early_exit` with the codes of this step; with others, the
        frame may have been left unread too early.
        """
        closed, unread = (0, 0) if frame is None else (frame.closed, frame.unread & ~frame.lost)
        if unread and self._policy.error_rate is None:
            self._scores.switches(closed & ~unread, lost)
            standing = Standing(self._scores.lanes(), self._reach, unread)
            if standing.certain:
                return standing, lost
        self._scores.switches(closed & ~(lost | unread), lost | unread)
        return Standing(self._scores.lanes(), self._reach), lost | unread

    def _decide(self, standing: Standing, missing: Missing) -> int | None:
        if missing.too_much:
            self._decider.forget()
            return None
        return self._decider.update(self._seen_us() or 0, standing, whole=not missing.names)

    def _health(self, standing: Standing, missing: Missing, decided: int | None) -> Health:
        if missing.too_much:
            return "unknown"
        if missing.names:
            return "degraded"
        return "changing" if decided is None or standing.contradicts(decided, self._lead) else "ok"

    def _published(
        self, now_us: int, unix_us: int, standing: Standing, missing: Missing, decided: int | None
    ) -> LiveGrasp:
        grasps, seen_us, number = self._build.grasps, self._seen_us(), self._number
        self._number += 1
        unknown = missing.too_much
        return LiveGrasp(
            time_us=now_us,
            unix_us=unix_us,
            number=number,
            grasp=UNKNOWN if decided is None else grasps[decided],
            candidate=UNKNOWN if unknown else grasps[standing.candidate],
            probability=0.0 if decided is None else standing.probability(decided, self._build.tables.scale),
            margin=0 if unknown else standing.margin,
            health=self._health(standing, missing, decided),
            switch_age_us=_age(now_us, self._switches.time_us),
            glove_age_us=_age(now_us, self._glove.time_us),
            latency_us=_age(now_us, seen_us) or 0,
            lost=missing.names,
        )

    def _seen_us(self) -> int | None:
        """Return when the newer of both frames was read."""
        times = [time_us for time_us in (self._switches.time_us, self._glove.time_us) if time_us is not None]
        return max(times, default=None)


def _decider(build: Build, policy: Policy) -> Decider:
    scale = build.tables.scale
    if policy.error_rate is None:
        return Decision(policy.lead_steps(scale), policy.dwell_us, policy.hold_us)
    return SequentialTest(len(build.grasps), scale, policy.error_rate, policy.hold_us, policy.spacing_us)


def _age(now_us: int, time_us: int | None) -> int | None:
    return None if time_us is None else now_us - time_us
