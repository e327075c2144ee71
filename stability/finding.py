"""The finding of a hard case: an error and its bound."""

import math

import msgspec

# The reference of most errors.
REFERENCE = "60 digits"


class Finding(msgspec.Struct, frozen=True):
    """One line of the table.

    check      the subject in a few words: "branch values"
    reference  the correct value: "60 digits", "every frame there is", "the rule itself"
    error      the worst error found, >= 0, in `unit`; for rules, the number of violations in the worst input
    bound      the largest valid error; the code that makes the finding derives it
    unit       "ulp", "steps", "score", "N", "rows", "outputs"
    tried      number of hard inputs
    worst      a description of the input with the worst error; "" if irrelevant
    beyond     number of errors beyond the bound; 0 if not counted
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
        """Whether at least one input was tried, and the error is a number within its bound."""
        return self.tried > 0 and math.isfinite(self.error) and self.error <= self.bound


class Case(msgspec.Struct, frozen=True):
    """A hard case: its title, and its numerical danger."""

    title: str
    danger: str


class Worst:
    """Collects the worst error over many inputs, and returns the finding."""

    def __init__(self, check: str, reference: str, bound: float, unit: str) -> None:
        self._about = check, reference, bound, unit
        self._error, self._at, self._tried, self._beyond = 0.0, "", 0, 0

    def see(self, error: float, at: str = "", tried: int = 1) -> None:
        """Add the error of an input named by `at`, or the worst of `tried` inputs. NaN counts as the worst error."""
        # numpy's numbers are not JSON.
        self._tried += int(tried)
        self._beyond += int(not error <= self._about[2])
        if not error <= self._error:
            self._error, self._at = (math.inf if math.isnan(error) else float(error)), at

    def finding(self) -> Finding:
        """Return the finding."""
        check, reference, bound, unit = self._about
        return Finding(check, reference, self._error, bound, unit, self._tried, self._at, self._beyond)
