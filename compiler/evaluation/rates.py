"""Recognition rates and their 95 % intervals."""

from dataclasses import dataclass
from math import fsum, sqrt
from statistics import fmean, stdev
from typing import Self

LEVEL = 0.95
_Z = 1.959963984540054  # the normal distribution's quantile of (1 + LEVEL) / 2


@dataclass(frozen=True, slots=True)
class RepeatedRate:
    """Recognised / all, over repeats of the same rows.

    correct  rows recognised in each repeat        mean       in 0..1
    total    rows of one repeat                    low, high  the 95 % interval of the mean

    The interval is the smallest that holds two others. Student's t over the repeats' rates says how much the cut into
    folds matters; but it has no width where all repeats agree, as at 100 %, and repeats share their rows. Wilson's
    interval of the mean over the `total` rows says how much the choice of rows matters:

        (p + z^2/2n +- z sqrt(p (1 - p)/n + z^2/4n^2)) / (1 + z^2/n)        (E. B. Wilson 1927; z = 1.96)

    With one repeat it is Wilson's alone. Where the rate is of several random draws, each repeated, Student's t is over
    the draws: the repeats of one draw say nothing of the next.
    """

    correct: tuple[int, ...]
    total: int
    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, correct: tuple[int, ...], total: int, repeats_a_draw: int = 1) -> Self:
        """Return the rate of `correct` rows of `total` in each repeat; ValueError unless 0 <= correct <= total > 0.

        `repeats_a_draw` repeats on end belong to one random draw; without draws each repeat stands for itself.
        """
        if not correct or total < 1 or not all(0 <= count <= total for count in correct):
            raise ValueError(f"{correct} recognised of {total} rows is no rate")
        mean = sum(correct) / (len(correct) * total)
        bounds = [_wilson(mean, total)]
        starts = range(0, len(correct), repeats_a_draw)
        if len(starts) > 1:
            bounds.append(_student([fmean(correct[i : i + repeats_a_draw]) / total for i in starts]))
        return cls(correct, total, mean, *_hull(mean, bounds))


@dataclass(frozen=True, slots=True)
class Average:
    """The plain average of several rates, and its 95 % interval.

    The rates' own intervals are combined as if they were independent (MOVER: Zou and Donner 2008, Statistics in
    Medicine 27): mean - sqrt(sum of (mean_i - low_i)^2) / k, and likewise above. It says how sure the average of THESE
    k subjects is, not what another subject would reach.
    """

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, rates: tuple[RepeatedRate, ...]) -> Self:
        """Return the average of one or more rates."""
        mean = fmean(rate.mean for rate in rates)
        # Not by `hypot`, whose last bit depends on the Python that runs.
        below = sqrt(fsum((rate.mean - rate.low) ** 2 for rate in rates)) / len(rates)
        above = sqrt(fsum((rate.high - rate.mean) ** 2 for rate in rates)) / len(rates)
        return cls(mean, *_hull(mean, [(mean - below, mean + above)]))


def _wilson(p: float, n: int) -> tuple[float, float]:
    centre = p + _Z**2 / (2 * n)
    reach = _Z * (p * (1 - p) / n + _Z**2 / (4 * n**2)) ** 0.5
    shrink = 1 + _Z**2 / n
    return (centre - reach) / shrink, (centre + reach) / shrink


def _student(rates: list[float]) -> tuple[float, float]:
    from scipy.special import stdtrit

    reach = float(stdtrit(len(rates) - 1, (1 + LEVEL) / 2)) * stdev(rates) / len(rates) ** 0.5
    return fmean(rates) - reach, fmean(rates) + reach


def _hull(mean: float, bounds: list[tuple[float, float]]) -> tuple[float, float]:
    """Smallest interval around all `bounds` and the mean (which rounding may put outside by a hair), within 0..1."""
    low = min([mean, *(low for low, _ in bounds)])
    high = max([mean, *(high for _, high in bounds)])
    return max(0.0, low), min(1.0, high)
