"""What is proved of the integers, as sentences and as a table of differences beside their bounds."""

from dataclasses import dataclass

from ..tables.compare import Comparison, WorstCase
from ..text import NBSP, counted, percent
from .content import ReportContent
from .plain_table import PlainTable


@dataclass(frozen=True, slots=True)
class GuaranteeView:
    """Sentences, and the table where the worst case was worked out."""

    sentences: tuple[str, ...]
    table: PlainTable | None


def guarantee_view(content: ReportContent) -> GuaranteeView:
    """Return what build.json proves, and what the worst case adds to it."""
    proof, rows = content.manifest.proof, content.manifest.source.rows
    sentences = (
        f"Scores are sums of integers, {proof.scale:.1f} steps to a unit of score. No sum of them, in any order and "
        f"with any inputs missing, goes beyond {proof.bound:,} steps, and so none leaves {proof.width} bits.",
        f"Rounding moves no score by more than {proof.error:g} steps, so that a lead of more than "
        f"{proof.safe_margin:g} steps keeps its grasp type: {_share(proof.covered, rows)} rows trained on have it. "
        f"{counted(proof.changed, 'row')} changed grasp type.",
    )
    found, worst = content.comparison, content.worst
    if found is None or worst is None:
        return GuaranteeView(sentences, None)
    return GuaranteeView((*sentences, _worst(worst, len(found.margins))), _table(found, worst, proof.width))


def _worst(worst: WorstCase, rows: int) -> str:
    return (
        f"At worst, over every frame there is and not only those recorded, {worst.leader} loses {worst.loss:.3f} steps "
        f"of its lead over {worst.rival}. Worked out exactly, ties in whole steps included, a lead of more than "
        f"{worst.safe_margin:.3f} steps is safe: {_share(worst.covered, rows)} rows trained on have it."
    )


def _table(found: Comparison, worst: WorstCase, width: int) -> PlainTable:
    most, integer_bound = 2 ** (width - 1) - 1, found.integer_bound + found.slack
    rows = (
        (
            "Ensemble against float tables, units of score",
            f"{found.collapse_difference:.3g}",
            f"{found.collapse_bound:.3g}",
        ),
        ("Float tables against integers, steps", f"{found.integer_difference:.3f}", f"{integer_bound:.3f}"),
        ("Most that a lead can lose, steps, all frames", f"{worst.loss:.3f}", f"{worst.bound:.3f}"),
        ("Furthest that a sum can get from zero, steps", f"{abs(worst.reach):,}", f"{most:,}"),
    )
    return PlainTable("Differences beside their bounds", ("What", "Found", "Bound"), rows)


def _share(count: int, total: int) -> str:
    return f"{count:,} of {total:,}" + (f" ({percent(count / total, NBSP)})" if total else "")
