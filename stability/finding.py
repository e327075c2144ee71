"""What a hard case finds: one number held against its bound."""

import math

import msgspec

# What most errors are held against.
REFERENCE = "60 digits"


class Finding(msgspec.Struct, frozen=True):
    """One line of the table.

    check      what was looked at, in a few words: "branch values"
    reference  the truth it is held against: "60 digits", "every frame there is", "the rule itself"
    error      the worst that was found, >= 0, in `unit`; of what must be true or false, those of the worst input that
               are not
    bound      the most it may be; the code that makes the finding says where it comes from
    unit       "ulp", "steps", "score", "N", "rows", "answers"
    tried      on how many hard inputs
    worst      which of them had the worst error, in words; "" where it does not matter
    beyond     how often an error beyond the bound was seen; 0 where that is not counted
    """

    check: str
    reference: str
    error: float
    bound: float
    unit: str
    tried: int
    worst: str = ""
    beyond: int = 0

    @property
    def holds(self) -> bool:
        """Whether something was tried, and the error is a number within its bound."""
        return self.tried > 0 and math.isfinite(self.error) and self.error <= self.bound


class Case(msgspec.Struct, frozen=True):
    """A hard case: its title, and what could go wrong in it."""

    title: str
    danger: str


class Worst:
    """Gathers the worst error over many inputs, and makes the finding of it."""

    def __init__(self, check: str, reference: str, bound: float, unit: str) -> None:
        self._about = check, reference, bound, unit
        self._error, self._at, self._tried, self._beyond = 0.0, "", 0, 0

    def see(self, error: float, at: str = "", tried: int = 1) -> None:
        """Take in the error of an input that `at` names, or the worst of `tried` inputs. NaN is the worst there is."""
        # numpy's numbers are no JSON.
        self._tried += int(tried)
        self._beyond += int(not error <= self._about[2])
        if not error <= self._error:
            self._error, self._at = (math.inf if math.isnan(error) else float(error)), at

    def finding(self) -> Finding:
        """Return what was found."""
        check, reference, bound, unit = self._about
        return Finding(check, reference, self._error, bound, unit, self._tried, self._at, self._beyond)
