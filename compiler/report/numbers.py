"""How the report writes numbers."""

from typing import Protocol

DASH = "–"
NBSP = "\N{NO-BREAK SPACE}"


class Interval(Protocol):
    """A rate in 0..1 with its 95 % interval: the evaluation's as well as the frontier's."""

    @property
    def mean(self) -> float:
        """The rate."""

    @property
    def low(self) -> float:
        """Lower end."""

    @property
    def high(self) -> float:
        """Upper end."""


def percent(share: float) -> str:
    """Return "96.3 %" of 0.963; the two stay on one line."""
    return f"{100 * share:.1f}{NBSP}%"


def interval(rate: Interval | None) -> str:
    """Return "96.3 [95.1, 97.2]", in percent; a dash for no rate."""
    return DASH if rate is None else f"{100 * rate.mean:.1f} [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"


def microseconds(us: float) -> str:
    """Return microseconds with no more digits than anybody reads: "48.1", "1,736"."""
    return f"{us:.1f}" if us < 100 else f"{us:,.0f}"


def share_of(count: int, total: int) -> str:
    """Return "12 of 40 (30.0 %)"; without rows, no share."""
    return f"{count:,} of {total:,}" + (f" ({percent(count / total)})" if total else "")


def counted(number: int, one: str, many: str = "") -> str:
    """Return "1 switch" or "2 switches"; `many` where it is not `one` with an s."""
    return f"{number:,} {one if number == 1 else many or one + 's'}"


def sentence(words: str) -> str:
    """Return words that stood within a sentence as one of their own."""
    return f"{words[:1].upper()}{words[1:].removesuffix('.')}."
