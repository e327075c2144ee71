"""The rules of a live recogniser: when it changes its decision, and when it makes none."""

import math

from msgspec import Struct

from thenar.drivers.errors import SettingError

# Limits beyond which no frames that a hand can hold would ever decide.
_LARGEST_LEAD = 1e6
_GRACE_US = 60_000
# Limit of the time for which paths are kept.
_LONGEST_LAG_US = 10_000_000


class Policy(Struct, frozen=True):
    """The rules of decisions. Raises SettingError if a value is out of range.

    lead        minimum lead of a new grasp type over the decided one: natural logarithm of the ratio of their
                probabilities (score units); a frame whose candidate has it is never "ok"
    dwell_us    time for which the new type must keep this lead in every frame
    hold_us     maximum time for which a grasp type is kept while frames favour others, or while none is whole; at least
                dwell_us
    max_lost    the largest share of the tables' weight (recogniser.py) that may be lost before "unknown" is reported
    grace_us    maximum age of a late record of the glove, used with health "degraded", before its joints are lost;
                None: four of its periods, at least 60 ms
    quarantine  whether switches that are read but wrong (quarantine.py) are treated as lost
    lag_us      segments: time after which the state of a moment is final; None: no segments are sought
    """

    lead: float = 0.5
    dwell_us: int = 50_000
    hold_us: int = 500_000
    max_lost: float = 0.5
    grace_us: int | None = None
    quarantine: bool = True
    lag_us: int | None = 150_000

    def __post_init__(self) -> None:
        if not 0 <= self.lead <= _LARGEST_LEAD:
            raise SettingError(f"a lead of {self.lead} is out of range: use 0 to {_LARGEST_LEAD}, in score units")
        if not 0 <= self.dwell_us <= self.hold_us:
            raise SettingError(
                f"a dwell of {self.dwell_us} us and a hold of {self.hold_us} us conflict: 0 <= dwell <= hold is needed"
            )
        if not 0 <= self.max_lost <= 1:
            raise SettingError(f"a lost share of {self.max_lost} is out of range: use 0 to 1")
        if self.lag_us is not None and not 0 <= self.lag_us <= _LONGEST_LAG_US:
            raise SettingError(f"a lag of {self.lag_us} us is out of range: use 0 to {_LONGEST_LAG_US}")
        if self.grace_us is not None and self.grace_us < 0:
            raise SettingError(f"a grace of {self.grace_us} us is out of range: use 0 or more")

    def grace_of(self, period_us: int) -> int:
        """Return `grace_us`, or the default for records every `period_us`."""
        return max(4 * period_us, _GRACE_US) if self.grace_us is None else self.grace_us

    def lead_steps(self, scale: float) -> int:
        """Return `lead` in the steps of tables with `scale` steps per unit, rounded up."""
        return math.ceil(self.lead * scale)
