"""What a person would rather look at: ranges over the rounds, ours beside Weka's, error against width."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from thenar.compiler.pictures import painting, rendered

from ..weka.beside import PARTED, Beside
from .axes import BLUE, FONT, GREEN, GREY, ORANGE, RED, band, curve, exponents, head, powers, rule, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .ranges import Ranges
    from .widths import Width

_NOTHING = 1e-17  # where a difference of exactly 0 stands on a logarithmic axis


def draw_ranges(trainings: Sequence["Ranges"], kind: str = "svg") -> bytes:
    """Return for one or two trainings least and greatest probability and weight, loss, and drift of the scores."""
    with painting(FONT):
        figure, ((shares, weights), (losses, drifts)) = sheet(2, 2, 5.6)
        for ranges, colour in zip(trainings, (BLUE, RED), strict=False):
            band(shares, ranges.least_probability, ranges.greatest_probability, colour)
            band(weights, ranges.least_weight, ranges.greatest_weight, colour)
            curve(losses, ranges.losses, colour)
            curve(drifts, ranges.mean_scores, colour, ranges.name)
        head(shares, "probability of a class, least and greatest")
        head(weights, "weight of a row, least above 0 and greatest")
        head(losses, "mean loss, nats")
        head(drifts, "|mean score| of a row, the largest, units of score")
        for axes in (shares, weights, losses, drifts):
            powers(axes, exponents(axes))
            axes.set_xlabel("round of boosting")
        figure.legend(frameon=False, loc="outside upper left", ncols=2)
        return rendered(figure, kind)


def draw_beside(beside: Beside, kind: str = "svg") -> bytes:
    """Return how far apart the held-out distributions of thenar and of Weka under two exp() are, after each round."""
    with painting(FONT):
        figure, ((axes,),) = sheet(1, 1, 4.1)
        lines = (
            (beside.weka_itself, RED, "-", "Weka and itself, under the JVM's two exp() settings"),
            (beside.ours_processor, ORANGE, "--", "thenar and Weka under the processor's exp(), the default"),
            (beside.ours_java, BLUE, "-", "thenar and Weka under the exp() written in Java"),
        )
        for differences, colour, style, label in lines:
            heights = [max(height, _NOTHING) for height in differences.largest]
            axes.plot(range(1, beside.rounds + 1), heights, color=colour, ls=style, lw=1.8, label=label)
        rule(axes, PARTED, beside.rounds, "below this, the same answer")
        if beside.weka_itself.parts is not None:
            axes.axvline(beside.weka_itself.parts, color=RED, lw=1)
            said = f"round {beside.weka_itself.parts}:\nWeka parts from itself"
            axes.annotate(said, (beside.weka_itself.parts, 1e-5), (6, 0), textcoords="offset points", color=RED)
        axes.set(xlim=(0, beside.rounds), xlabel="round of boosting", ylabel="largest difference of a probability")
        powers(axes, range(-16, 1, 4))
        axes.set_ylim(_NOTHING, 30)
        figure.legend(frameon=False, loc="outside upper left")
        return rendered(figure, kind)


def draw_widths(widths: Sequence["Width"], kind: str = "svg") -> bytes:
    """Return what a lead loses at worst and the recognition rate kept, by the width of the tables' integers."""
    with painting(FONT):
        figure, ((losses, rates),) = sheet(1, 2, 3.4)
        bits, rows = [width.bits for width in widths], widths[0].total
        losses.plot(bits, [each.bound for each in widths], color=GREY, ls=":", label="bound: inputs + 1 steps")
        _dots(losses, bits, [each.worst for each in widths], BLUE, "the worst of all frames")
        _dots(rates, bits, [100 * each.correct / rows for each in widths], GREEN, "")
        head(losses, "what a lead loses at worst, units of score")
        head(rates, f"recognition rate, % of {rows} unseen rows")
        powers(losses, exponents(losses))
        losses.legend(frameon=False)
        rule(rates, 100 * widths[0].correct_ensemble / rows, bits[-1], "the ensemble, in doubles")
        rates.grid(axis="y", color="#dddddd", lw=0.6)
        for axes in (losses, rates):
            axes.set(xlabel="bits an entry of the tables", xticks=bits[::2])
        return rendered(figure, kind)


def _dots(axes: "Axes", bits: list[int], heights: list[float], colour: str, label: str) -> None:
    axes.plot(bits, heights, color=colour, marker="o", ms=4, lw=1.6, label=label)
