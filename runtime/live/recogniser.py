"""The live recogniser: joins the newest frame of each device, scores it and decides."""

from collections.abc import Sequence

import msgspec
import numpy as np
from msgspec.structs import replace

from ..build import Build
from ..calibration import Joints, Meaning
from ..frames import PERIODS, GloveFrame, Mask, Newest, SwitchFrame
from ..model.integers import IntegerTables
from ..policy import Policy
from ..published import UNKNOWN, Health, JointAngles, LiveGrasp, Preshape
from ..segmenting.decoder import LiveSegments, Segment
from .decision import Decision, Ranking
from .quarantine import Quarantine


class Moment(msgspec.Struct):
    """A published grasp, and the data behind it.

    grasp     the grasp type and its confidence
    switches  the newest frame of the switches; None before the first
    glove     the newest record of the CyberGlove; None before the first
    codes     the joints' codes that were scored; None while the joints are lost
    preshape  the preshape that the robot's hand should have now; None to send it nothing, as before the first grasp has
              settled (`PreshapeSelector`: 0.1 s)
    angles    the glove's joints; None without a calibration, and while the glove says nothing
    scores    those of all classes of segments; None while too little can be read
    refused   whether the build refuses their frame
    """

    grasp: LiveGrasp
    switches: SwitchFrame | None
    glove: GloveFrame | None
    codes: Sequence[int] | None
    preshape: Preshape | None = None
    angles: JointAngles | None = None
    scores: Sequence[int] | None = None
    refused: bool = False


class LiveRecognizer:
    """Joins switches and CyberGlove and recognises grasps, with whichever of them are available.

    A frame is current for two of its periods. An older record of the glove is used until `policy.grace_us`, with health
    "degraded". Inputs that are older still, or lost, or of a glove that is not plugged into its box, are replaced by
    their mean contribution, with health "degraded"; health is "unknown" when the lost share of the tables' weight
    exceeds `policy.max_lost`, and when no input of the build is left. A switch that is read but wrong is treated as
    lost (`quarantine`). A device whose kind the build does not use is ignored. The result depends only on the given
    frames and their times, so a replay of the same calls gives the same results.
    """

    def __init__(
        self,
        build: Build,
        *,
        sensor_names: Sequence[str] = (),
        calibration: Meaning = None,
        switch_period_us: int | None = None,
        glove_period_us: int | None = None,
        policy: Policy | None = None,
    ) -> None:
        """Take the names of the CyberGlove's sensors in wire order, and periods; None: there is no such device.

        Raises SettingError if the CyberGlove cannot serve the build.
        """
        self._scorer, self._policy, self._grasps = build.scorer, policy or Policy(), build.classes
        tables = build.tables
        self._scale, self._all_switches = tables.scale, (1 << tables.n_switches) - 1
        self._reads_switches = switch_period_us is not None and tables.n_switches > 0
        self._longest_us = PERIODS * (switch_period_us or 0)
        self._switches = Newest[SwitchFrame]()
        grace_us = self._policy.grace_of(glove_period_us or 0)
        self._joints = Joints(build.manifest.joints, sensor_names, calibration, glove_period_us, grace_us)
        # Closed and lost switches, codes, and lost joints: a hand at rest is scored and ranked once.
        self._state: tuple[Mask, Mask, Sequence[int] | None, Mask] | None = None
        self._missing = MissingInputs(build, self._policy.max_lost)
        self.quarantine = Quarantine(build, self._missing.may_be_lost, active=self._policy.quarantine)
        self._all_joints = (1 << tables.n_joints) - 1
        self._lead = self._policy.lead_steps(tables.scale)
        self._decider = Decision(self._lead, self._policy.dwell_us, self._policy.hold_us)
        lag_us, model = self._policy.lag_us, build.manifest.segmenting
        self._segments = None if lag_us is None else LiveSegments(model, build.grasps, lag_us)
        self._number = 0

    def _trusted(self, frame: SwitchFrame | None, joints_lost: Mask) -> SwitchFrame | None:
        """Return the frame with the quarantined switches marked as lost."""
        out = self.quarantine.left_out(self._all_switches if frame is None else frame.lost, joints_lost)
        return replace(frame, lost=frame.lost | out) if out and frame is not None else frame

    def step(self, now_us: int, unix_us: int, switches: SwitchFrame | None, glove: GloveFrame | None) -> Moment:
        """Return the prediction at `now_us`, given the frames since the last step (None: none).

        The same frame may be passed again: it keeps its age. Raises FrameError for a frame of another glove.
        """
        newest = self._switches
        if switches is not None and switches is not newest.frame and self._reads_switches:
            newest.take(switches, now_us, self._longest_us)
        read = newest.frame if now_us <= newest.expires_us else None
        codes = self._joints.codes(now_us, glove if read is None or read.glove is None else read.glove)
        late = codes is not None and self._joints.late(now_us)
        joints_lost = self._all_joints if codes is None else 0
        frame = self._trusted(read, joints_lost)
        lost_joints = self._joints.lost if codes else 0
        closed, lost = (0, self._all_switches) if frame is None else (frame.closed & ~frame.lost, frame.lost)
        if (state := (closed, lost, codes, lost_joints)) != self._state:
            self._biased_scores = self._scorer.state_scores(*state)
            ranked, self._refused = self._scorer.with_none(self._biased_scores, *state)
            self._ranking, self._state = Ranking(ranked), state
        biased_scores, standing, refused = self._biased_scores, self._ranking, self._refused
        missing, too_much = self._missing.of(lost, lost_joints | joints_lost)
        if read is not None:
            self.quarantine.look(read, biased_scores, lost)
        seen_us = max(newest.time_us, self._joints.newest.time_us)
        if too_much:
            self._decider.forget()
            decided = None
        else:
            decided = self._decider.update(max(seen_us, 0), standing, whole=not (missing or late))
        scores, refused = (None, False) if too_much else (biased_scores, refused)
        segment = Segment() if self._segments is None else self._segments.update(now_us, scores, refused)
        grasp = self._published(now_us, unix_us, standing, missing, too_much, decided, seen_us, segment, late)
        self._number += 1
        return Moment(grasp, switches, glove, codes, scores=scores, refused=refused)

    def _published(
        self,
        now_us: int,
        unix_us: int,
        standing: Ranking,
        missing: tuple[str, ...],
        unknown: bool,
        decided: int | None,
        seen_us: int,
        segment: Segment,
        late: bool,
    ) -> LiveGrasp:
        switches_us, glove_us = self._switches.time_us, self._joints.newest.time_us
        health: Health = "ok"
        if unknown:
            health = "unknown"
        elif missing or late:
            health = "degraded"
        elif decided is None or standing.contradicts(decided, self._lead):
            health = "changing"
        probability = 0.0 if decided is None else standing.probability(decided, self._scale)
        label, of_segment = segment.label, 0.0
        if label is not None and not unknown:
            of_segment = probability if label == decided else standing.probability(label, self._scale)
        # Keyword arguments would take a third of the time of everything else for seventeen fields.
        return LiveGrasp(
            now_us,
            unix_us,
            self._number,
            UNKNOWN if decided is None else self._grasps[decided],
            UNKNOWN if unknown else self._grasps[standing.candidate],
            probability,
            0 if unknown else standing.margin,
            health,
            None if switches_us < 0 else now_us - switches_us,
            None if glove_us < 0 else now_us - glove_us,
            0 if seen_us < 0 else now_us - seen_us,
            missing,
            segment.state,
            segment.number,
            segment.type,
            segment.began_us,
            of_segment,
        )


class MissingInputs:
    """Determines the missing inputs, and keeps the last result: losses seldom change.

    The weight of an input is the distance between its rows (for a switch: closed and open), summed over the grasp
    types, in steps: an input that never moves a score has no weight. Too much is lost when the lost inputs' share of
    the total weight exceeds `max_lost`, and when no input of the build can be read.
    """

    def __init__(self, build: Build, max_lost: float) -> None:
        switches, joints = build.manifest.switches, build.manifest.joints
        self._names = [*(switch.name for switch in switches), *(joint.name for joint in joints)]
        self._weights, self._n_switches = weights(build.tables), len(switches)
        self._total = sum(self._weights)
        self._max_lost = max_lost
        self._state: Mask = 0
        self._last: tuple[tuple[str, ...], bool] = (), False

    def of(self, switches: Mask, joints: Mask) -> tuple[tuple[str, ...], bool]:
        """Return the names of the missing inputs when these are lost, and whether too much is."""
        lost = switches | joints << self._n_switches
        if lost != self._state:
            self._state, self._last = lost, self._work_out(lost)
        return self._last

    def may_be_lost(self, switches: Mask, joints: Mask) -> bool:
        """Return whether a grasp can be recognised without these."""
        return not self._work_out(switches | joints << self._n_switches)[1]

    def _work_out(self, lost: Mask) -> tuple[tuple[str, ...], bool]:
        numbers = [number for number in range(len(self._names)) if lost >> number & 1]
        nothing_left = len(numbers) == len(self._names)
        share = 1.0 if nothing_left else sum(map(self._weights.__getitem__, numbers)) / max(self._total, 1)
        names = tuple(map(self._names.__getitem__, numbers))
        return names, nothing_left or share > self._max_lost


def weights(tables: IntegerTables) -> list[int]:
    """Return the weight of each switch, and of each joint after them, in steps."""
    switches: list[int] = np.abs(tables.switch_rows.astype(np.int64)).sum(axis=1).tolist()
    added = (tables.choices(joint)[1] for joint in range(tables.n_joints))
    return [*switches, *(int(np.ptp(rows, axis=0).sum()) for rows in added)]
