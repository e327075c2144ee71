"""A hard case, and its findings: errors and their bounds."""

import math

import msgspec

# The reference of most errors.
REFERENCE = "60 digits"


class Case(msgspec.Struct, frozen=True):
    """A hard case: its title, and its numerical danger."""

    title: str
    danger: str


class Finding(msgspec.Struct):
    """One line of the table: the worst error of many inputs.

    check      the subject in a few words: "branch values"
    reference  the correct value: "60 digits", "every frame there is", "the rule itself"
    error      the worst error found, >= 0, in `unit`; for rules, the number of violations in the worst input
    bound      the largest valid error; the code that makes the finding derives it
    unit       "ulp", "steps", "score", "N", "rows", "outputs"
    tried      number of hard inputs
    worst      a description of the input with the worst error; "" if irrelevant
    beyond     number of errors beyond the bound; 0 if not counted
    holds      whether at least one input was tried, and the error is a number within its bound
    """

    check: str
    reference: str
    error: float
    bound: float
    unit: str
    tried: int
    worst: str = ""
    beyond: int = 0
    holds: bool = False

    def __post_init__(self) -> None:
        self.holds = self.tried > 0 and math.isfinite(self.error) and self.error <= self.bound

    @classmethod
    def of(cls, check: str, reference: str, bound: float, unit: str) -> "Finding":
        """Return the finding before any input; `see` adds inputs."""
        return cls(check, reference, 0.0, bound, unit, 0)

    def see(self, error: float, at: str = "", tried: int = 1) -> None:
        """Add the error of an input named by `at`, or the worst of `tried` inputs. NaN counts as the worst error."""
        # numpy's numbers are not JSON.
        self.tried += int(tried)
        self.beyond += int(not error <= self.bound)
        if not error <= self.error:
            self.error, self.worst = (math.inf if math.isnan(error) else float(error)), at
        self.__post_init__()
