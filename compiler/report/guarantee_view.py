"""What is proved of the integers, as sentences and as a table of differences beside their bounds."""

from dataclasses import dataclass

from ..text import NBSP, counted, percent
from .content import ReportContent
from .guarantee import Guarantee
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
    found = content.guarantee
    if found is None:
        return GuaranteeView(sentences, None)
    return GuaranteeView((*sentences, _worst(found)), _table(found, proof.width))


def _worst(found: Guarantee) -> str:
    return (
        f"At worst, over every frame there is and not only those recorded, {found.leader} loses {found.loss:.3f} steps "
        f"of its lead over {found.rival}. Worked out exactly, ties in whole steps included, a lead of more than "
        f"{found.safe_margin:.3f} steps is safe: {_share(found.covered, found.rows)} rows trained on have it."
    )


def _table(found: Guarantee, width: int) -> PlainTable:
    most = 2 ** (width - 1) - 1
    rows = (
        (
            "Ensemble against float tables, units of score",
            f"{found.collapse_difference:.3g}",
            f"{found.collapse_bound:.3g}",
        ),
        ("Float tables against integers, steps", f"{found.integer_difference:.3f}", f"{found.integer_bound:.3f}"),
        ("Most that a lead can lose, steps, all frames", f"{found.loss:.3f}", f"{found.loss_bound:.3f}"),
        ("Furthest that a sum can get from zero, steps", f"{abs(found.reach):,}", f"{most:,}"),
    )
    return PlainTable("Differences beside their bounds", ("What", "Found", "Bound"), rows)


def _share(count: int, total: int) -> str:
    return f"{count:,} of {total:,}" + (f" ({percent(count / total, NBSP)})" if total else "")
