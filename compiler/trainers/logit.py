"""The additive multinomial logit: all score tables fitted at once, the unique minimum of a convex function."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.line import Line

from ..elementary import Floats
from ..samples import TrainingError
from ..workers import check_memory
from .base import MAX_BINS, Report, Setting, Trainer, check_rows
from .newton import DRAFT, TOLERANCE, Column, Fit, Ruler, columns_of

if TYPE_CHECKING:
    from ..samples import Samples

BINS = 16
PENALTY, SMOOTHNESS = 0.5, 2.0
FINEST = 1e-12  # the least tolerance
_FEWER = 3.0  # the pull on the weights that remain is smaller by this factor


@dataclass(frozen=True, slots=True, eq=False)
class ColumnTables:
    """F_k(x) = bias_k + sum over columns of rows[column][bin, k], for columns of bits or codes.

    bias   (K,)
    edges  for each column, ascending (B - 1,): the bin of x is the number of edges below it
    rows   for each column (B, K)
    lines  for some columns (low, high, row): an additional contribution, row (K,) times (x - low), of x between both
    """

    bias: Floats
    edges: tuple[Floats, ...]
    rows: tuple[Floats, ...]
    lines: Mapping[int, tuple[float, float, Floats]] = field(default_factory=dict)

    def score_tables(self, n_switches: int) -> ScoreTables:
        """Return the tables of [switches | joint codes], the first `n_switches` columns being switches."""
        bias, switch_rows = self.bias, np.zeros((n_switches, len(self.bias)))
        for column in range(n_switches):
            opened, closed = self.rows[column][np.searchsorted(self.edges[column], [0.0, 1.0])]
            bias, switch_rows[column] = bias + opened, closed - opened
        # An edge lies between two codes, and a threshold is the last code of a bin.
        thresholds = [np.floor(edges).astype(np.uint16) for edges in self.edges[n_switches:]]
        lines = (Line(column - n_switches, int(low), int(high), row) for column, (low, high, row) in self.lines.items())
        return ScoreTables.of(bias, switch_rows, thresholds, self.rows[n_switches:], [*lines])


def fit_logit(
    X: NDArray[np.generic],
    labels: NDArray[np.intp],
    n_classes: int,
    *,
    penalty: float = PENALTY,
    smoothness: float = SMOOTHNESS,
    max_bins: int | None = BINS,
    linear: bool = False,
    sparsity: float = 0.0,
    tolerance: float = TOLERANCE,
    counted: int = 0,
    held: NDArray[np.bool_] | None = None,
) -> ColumnTables:
    """Fit X (n, d) bits and integer codes, and labels (n,) in 0..n_classes-1.

    `penalty` pulls rows towards zero, `smoothness` pulls those of neighbouring bins towards each other. Columns have at
    most `max_bins` bins (2 or more; None: one for each value) that hold frames as evenly as possible. With `linear` a
    column of more than two values adds scores in proportion to them, between minimum and maximum, and `smoothness`
    pulls the contribution of one standard deviation; a share of these weights, `sparsity`, is 0, relative to the last
    class. The number of set bits among the first `counted` columns adds scores as well, with the weak pull of a bin, so
    that their common effect is learned at once. Frames in `held` (n,) are known not to be of the last class, which
    learns nothing from them. No derivative of the loss is larger at the solution than `tolerance` times the number of
    frames. Raises TrainingError.
    """
    if not (0 < penalty < math.inf and 0 <= smoothness < math.inf):
        raise TrainingError(f"penalty={penalty} must be above 0, and smoothness={smoothness} at least 0, both finite")
    if max_bins is not None and max_bins < 2:
        raise TrainingError(f"max_bins={max_bins} must be at least 2: a single bin carries no information")
    if not FINEST <= tolerance < 1:
        raise TrainingError(f"tolerance={tolerance} must be at least {FINEST:g} and below 1")
    check_rows(X, labels, n_classes, None)
    if X.dtype.kind == "f" and np.isnan(X).any():
        raise TrainingError("the inputs hold NaN: a logit has no scores for a missing value")
    check_memory(len(X), n_classes, TrainingError, *X.shape[1:])
    columns = columns_of(X, max_bins, straight=linear)
    count = count_of(columns[:counted])
    every = [*columns, *count]
    rows = Fit(every, labels, n_classes, penalty, smoothness, held).minimum(tolerance)
    if sparsity and (free := _large(columns, rows, sparsity)) is not None:
        rows = Fit(every, labels, n_classes, penalty / _FEWER, smoothness / _FEWER, held, free).minimum(tolerance)
    return tables_of(columns, spread_out(columns, rows, count))


def _large(columns: Sequence[Column], rows: Floats, sparsity: float) -> NDArray[np.bool_] | None:
    """Return which of the rows (r, K) remain if a share of the lines' weights is 0 relative to the last class, as are
    all of that class itself; None without lines.
    """
    starts = 1 + np.cumsum([0, *(column.n_rows for column in columns[:-1])])
    lines = [(start, column.line) for start, column in zip(starts.tolist(), columns, strict=True) if column.line]
    if not lines:
        return None
    places = [start for start, _ in lines]
    deviations = np.sqrt([line.variance for _, line in lines])[:, np.newaxis]
    sizes = (np.abs(rows[places, :-1] - rows[places, -1:]) * deviations).ravel()
    small, kept = np.argsort(sizes, kind="stable")[: round(sparsity * sizes.size)], np.ones(sizes.size, np.bool_)
    kept[small] = False
    free = np.ones(rows.shape, np.bool_)
    free[places, -1], free[places, :-1] = False, kept.reshape(len(places), -1)
    return free


def count_of(columns: Sequence[Column]) -> list[Column]:
    """Return a list with a column that counts the set bits of `columns`; an empty list if the count adds no
    information.
    """
    bits = [column.bins for column in columns if column.counts]
    number: Floats = np.add.reduce(bits, axis=0).astype(np.float64) if len(bits) > 1 else np.zeros(1)
    if number.min() == number.max():
        return []
    return [Column(np.zeros(0), np.zeros(len(number), np.intp), 0, Ruler.of(number), free=True)]


def spread_out(columns: Sequence[Column], rows: Floats, count: Sequence[Column]) -> Floats:
    """Return rows of `columns` that include the contribution of their count, the last column."""
    if not count or count[0].line is None:
        return rows
    ruler, rows, each = count[0].line, rows[:-1].copy(), rows[-1] / count[0].line.unit
    rows[0] -= (ruler.low + ruler.unit * ruler.centre) * each
    starts = 1 + np.cumsum([0, *(column.n_rows for column in columns[:-1])])
    rows[[start for start, column in zip(starts.tolist(), columns, strict=True) if column.counts]] += each
    return rows


def tables_of(columns: Sequence[Column], rows: Floats) -> ColumnTables:
    """Return the rows (r, K) of a minimum as tables."""
    bias, *parts = np.split(rows, np.cumsum([1, *(column.n_rows for column in columns[:-1])])) if columns else [rows]
    bias, tables, lines = bias[0], [], {}
    for number, (column, own) in enumerate(zip(columns, parts, strict=True)):
        if column.line is not None:
            bias = bias - column.line.centre * own[0]
            lines[number] = column.line.low, column.line.high, own[0] / column.line.unit
            own = np.zeros_like(own)
        tables.append(np.vstack([np.zeros((column.first, own.shape[1])), own]))
    return ColumnTables(bias, tuple(column.edges for column in columns), tuple(tables), lines)


class Logit(Trainer):
    """Multinomial logistic regression on tables of each input, with a penalty; convex, so the solution is unique."""

    name = "logit"
    what = "multinomial logistic regression on a table for each input"
    automatic = False  # it is better than the others in none of our sets
    settings = (
        Setting("penalty", "Pull of scores towards zero.", float, PENALTY, 1e-6, 1e6),
        Setting(
            "smoothness",
            "Pull of a joint's neighbouring bins towards each other, and of its line towards zero.",
            float,
            SMOOTHNESS,
            0.0,
            1e6,
        ),
        Setting("max_bins", MAX_BINS, int, BINS, 2),
    )

    # The best smoothness grows with the number of bins: more bins mean smaller steps between them.
    drafting = DRAFT
    tried = (
        {"penalty": 1.0, "smoothness": 4.0, "max_bins": 16},
        {"penalty": 3.0, "smoothness": 24.0, "max_bins": 32},
        {"penalty": 0.3, "smoothness": 1.5, "max_bins": 32},
    )

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> ScoreTables:
        """Return the tables. Raises TrainingError for settings that make no sense."""
        given = {**settings, "max_bins": settings["max_bins"] or BINS}
        tables = fit_logit(samples.inputs, samples.labels, samples.n_classes, **given, **of_none(samples))
        return tables.score_tables(samples.n_switches)


def of_none(samples: "Samples") -> dict[str, Any]:
    """Return additional arguments of the logit where some rows hold nothing.

    All switches are evidence against nothing held, so their number is an input too; static grasps are known to be held
    and teach the class of nothing held nothing.
    """
    return {"counted": samples.n_switches, "held": samples.given_held} if samples.has_none else {}


MEMBER = Logit()
