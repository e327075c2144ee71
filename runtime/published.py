"""The data published to terminals, files, sockets and robots: every frame's grasp, and the glove's health."""

from typing import Literal

import msgspec

UNKNOWN = "unknown"
# Nothing is held: a type that every taxonomy has in addition to its own.
NONE = "none"

Health = Literal["ok", "changing", "degraded", "unknown"]
State = Literal["none", "forming", "held", "releasing"]


class LiveGrasp(msgspec.Struct, frozen=True, omit_defaults=False):
    """The current prediction and its confidence.

    time_us       host's monotonic clock when this was calculated; unix_us: the same moment in Unix time
    number        counts the frames of this run from 0
    grasp         the decided grasp type, "unknown" while too little can be read
    candidate     the best grasp type of this frame alone
    probability   of `grasp` in this frame (softmax of the scores); 0 when unknown
    margin        lead of the candidate over the second best, in integer steps
    health        "ok": everything is read, `grasp` was decided on whole frames, and the candidate does not lead it by
                  the lead that a change takes (policy.py) or more. "changing": everything is read, but the candidate
                  leads `grasp` by that much, and the dwell time has not passed. "degraded": means replace lost inputs,
                  or the glove's record is late. "unknown": too much is lost
    switch_age_us, glove_age_us   how old the newest frames are; None before the first, or without such a device
    latency_us    from the newer of both frames to this moment
    lost          names of the switches and joints that are missing
    state         "none": nothing is held. "forming": a segment of a grasp type begins, but may still be revoked.
                  "held": it has begun. "releasing": it seems to end
    segment       counts the segments of a grasp type of this run from 1; 0 before the first
    segment_type  the type of the segment, "none" between segments
    segment_us    when the segment began, on the clock of `time_us`; None between segments
    segment_probability  of `segment_type` in this frame; 0 between segments, and when unknown
    """

    time_us: int
    unix_us: int
    number: int
    grasp: str
    candidate: str
    probability: float
    margin: int
    health: Health
    switch_age_us: int | None
    glove_age_us: int | None
    latency_us: int
    lost: tuple[str, ...] = ()
    state: State = "none"
    segment: int = 0
    segment_type: str = NONE
    segment_us: int | None = None
    segment_probability: float = 0.0


class JointAngles(msgspec.Struct, frozen=True):
    """The names of the joints that are calibrated, and their angles in rad, as a robot's messages have them."""

    names: tuple[str, ...]
    positions_rad: tuple[float, ...]


class Preshape(msgspec.Struct, frozen=True):
    """One point of a trajectory, as in trajectory_msgs/JointTrajectory.

    name               its name in the table; several grasp types may share a preshape
    joint_names        the robot's joints, in the table's order
    positions          one per joint: rad for a joint that turns, m for one that slides, as usual in ROS
    time_from_start_s  when the hand must arrive, counted from the moment of sending
    """

    name: str
    joint_names: tuple[str, ...]
    positions: tuple[float, ...]
    time_from_start_s: float


class Count(msgspec.Struct, frozen=True):
    """The number of times that something happened: CRC errors, resynchronisations, frames lost."""

    name: str
    value: int


class DeviceHealth(msgspec.Struct, frozen=True):
    """A device: whether it is connected, its current or last error, and its driver's counters."""

    name: str
    connected: bool
    error: str = ""
    counts: tuple[Count, ...] = ()


class Quarantined(msgspec.Struct, frozen=True):
    """A switch that is read but wrong, why ("stuck closed", "stuck open", "chattering"), and whether it is still
    `used`: because too much would be lost without it, or because the policy says so.
    """

    name: str
    reason: str
    used: bool = False

    @property
    def what(self) -> str:
        """Both in words: "stuck closed, treated as lost"."""
        return f"{self.reason}, {'still used' if self.used else 'treated as lost'}"


class OutputTrouble(msgspec.Struct, frozen=True):
    """The recording or a sink that takes nothing or loses something, and why, in words."""

    name: str
    what: str


class HealthReport(msgspec.Struct, frozen=True):
    """State at `time_us` of the host's monotonic clock.

    switch_hz, glove_hz        frames per second over the last whole second
    frames, changing, degraded, unknown  numbers of grasps published so far, in all and with that health
    overflowed                 frames that arrived but were not taken in time: a recording lacks them
    devices                    as reported by their drivers
    quarantined                inputs that are read but wrong
    outputs                    the recording and the sinks, as long as they take nothing
    """

    time_us: int
    switch_hz: float
    glove_hz: float
    frames: int
    changing: int
    degraded: int
    unknown: int
    overflowed: int = 0
    devices: tuple[DeviceHealth, ...] = ()
    quarantined: tuple[Quarantined, ...] = ()
    outputs: tuple[OutputTrouble, ...] = ()
