"""What is published of every frame: to the terminal, to files, to sockets, to a robot."""

from typing import Literal

import msgspec

UNKNOWN = "unknown"

Health = Literal["ok", "changing", "degraded", "unknown"]


class LiveGrasp(msgspec.Struct, frozen=True, omit_defaults=False):
    """What is recognised now, and how far to trust it.

    time_us       host's monotonic clock when this was worked out; unix_us: the same moment as the date has it
    number        counts the frames of this run from 0
    grasp         the grasp type decided on, "unknown" while too little can be read and before a sequential test ends
    candidate     the best grasp type of this frame alone
    probability   of `grasp` in this frame (softmax of the scores); 0 when unknown
    margin        lead of the candidate over the second best, in integer steps
    health        "ok": everything is read, `grasp` was decided on whole frames, and the candidate does not lead it by
                  the lead that a change takes (policy.py) or more. "changing": everything is read, but the candidate
                  leads `grasp` by that much, and the change has not dwelt yet; or no sequential test has ended yet.
                  "degraded": means stood in for something that is lost. "unknown": too much is lost
    switch_age_us, glove_age_us   how old the newest frames are; None before the first, or without such a device
    latency_us    from the newer of both frames to this moment
    lost          names of the switches and joints that are missing
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
