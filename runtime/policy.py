"""How a live recogniser decides: when it changes its mind, when it no longer answers."""

import math
from dataclasses import dataclass

from thenar.drivers.errors import SettingError

# Beyond them no frames that a hand can hold ever decide.
_LARGEST_LEAD = 1e6
_LEAST_RATE = 1e-100
_GRACE_US = 60_000
# Paths are kept for so long.
_LONGEST_LAG_US = 10_000_000


@dataclass(frozen=True, slots=True)
class Policy:
    """Raises SettingError if a value is out of range.

    lead        a new grasp type must lead the one decided on by so much: natural logarithm of the ratio of their
                probabilities (score units); a frame whose candidate does is never "ok"
    dwell_us    and must do so in every frame for so long
    hold_us     the longest that a grasp type is kept while frames speak for others, or while none is whole; at least
                dwell_us
    max_lost    the largest share of the tables' weight (recogniser.py) that may be lost before the answer is "unknown"
    error_rate  None: hysteresis and dwell (decision.py) decide. A rate: a sequential test (decision.py) does, which
                ends wrong no more often, under the assumptions that it states; `dwell_us` is not used then, and
                `hold_us` is the longest that one test may take and that its answer holds
    spacing_us  sequential test: frames count only if they are so far apart
    grace_us    how long after it was measured a late record of the glove still serves, the answer degraded, before its
                joints are lost; None: four of its periods, at least 60 ms
    quarantine  whether inputs that are read and yet wrong (quarantine.py) are treated as lost
    lag_us      segments: how long after a moment its state is said for good; None: no segments are sought
    """

    lead: float = 0.5
    dwell_us: int = 50_000
    hold_us: int = 500_000
    max_lost: float = 0.5
    error_rate: float | None = None
    spacing_us: int = 0
    grace_us: int | None = None
    quarantine: bool = True
    lag_us: int | None = 150_000

    def __post_init__(self) -> None:
        if not 0 <= self.lead <= _LARGEST_LEAD:
            raise SettingError(f"a lead of {self.lead}: it is 0 to {_LARGEST_LEAD}, in score units")
        if not 0 <= self.dwell_us <= self.hold_us:
            raise SettingError(f"a dwell of {self.dwell_us} us and a hold of {self.hold_us} us: 0 <= dwell <= hold")
        if not 0 <= self.max_lost <= 1:
            raise SettingError(f"a share of {self.max_lost} that may be lost: it is 0 to 1")
        if self.error_rate is not None and not _LEAST_RATE <= self.error_rate < 1:
            raise SettingError(f"an error rate of {self.error_rate}: it lies between 0 and 1, from {_LEAST_RATE} on")
        if self.lag_us is not None and not 0 <= self.lag_us <= _LONGEST_LAG_US:
            raise SettingError(f"a lag of {self.lag_us} us: it is 0 to {_LONGEST_LAG_US}")
        if self.grace_us is not None and self.grace_us < 0:
            raise SettingError(f"a grace of {self.grace_us} us: it is 0 or more")
        if self.spacing_us < 0:
            raise SettingError(f"frames {self.spacing_us} us apart: it is 0 or more")

    def grace_of(self, period_us: int) -> int:
        """Return `grace_us`, or what is usual where records come every `period_us`."""
        return max(4 * period_us, _GRACE_US) if self.grace_us is None else self.grace_us

    def lead_steps(self, scale: float) -> int:
        """Return `lead` in the steps of tables with `scale` steps per unit, rounded up."""
        return math.ceil(self.lead * scale)
