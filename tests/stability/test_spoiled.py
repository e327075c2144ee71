"""Each case of the catalogue notices a fault: one spoiled input a case, and the checks that must then fail.

EVERY stands for all checks of a case.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import msgspec
import numpy as np
import pytest

from thenar.compiler import elementary as arithmetic
from thenar.compiler import elementary as functions
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.model import collapse
from thenar.compiler.placement import gain
from thenar.compiler.placement.gain import Cooccurrence
from thenar.compiler.placement.tree import grow_id3
from thenar.compiler.trainers import stumps
from thenar.compiler.trainers.logit import ColumnTables, fit_logit
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.trainers.pairs import fit_pairs
from thenar.compiler.trainers.stumps import FittedStumps, Targets, fit_stumps
from thenar.runtime.build import Build, Recognition
from thenar.runtime.model import quantise
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.scores import Scorer
from thenar.simulator.contact.settle import Rest, close
from thenar.stability.cases import (
    codes,
    columns,
    contact,
    contradictions,
    degenerate,
    elementary,
    information,
    invariances,
    logits,
    missing,
    platform,
    quantisation,
    scoretables,
    separable,
    stumpfits,
    targets,
    weights,
)
from thenar.stability.inputs.small_sets import small_build
from thenar.stability.report import CASES, load

Patch = pytest.MonkeyPatch
EVERY = ("",)


def heavier_row(X: Any, y: Any, K: int, **options: Any) -> Any:
    """Train as if the first row weighed three times as much, or a third."""
    weights = options.pop("weights", None)
    weights = np.ones(len(y)) if weights is None else np.array(weights)
    weights[0] *= 3 if weights[0] < 1e300 else 1 / 3
    return boost(X, y, K, **options, weights=weights)


def spoil_elementary(patch: Patch) -> None:
    patch.setattr(elementary, "exp", lambda x: np.nextafter(functions.exp(x), np.inf) + np.spacing(functions.exp(x)))
    patch.setattr(elementary, "log", lambda x: functions.log(x) * (1 + 2.0**-50))
    patch.setattr(elementary, "sincos", lambda x: tuple(part * (1 + 2.0**-50) for part in functions.sincos(x)))
    patch.setattr(elementary, "softmax", lambda F: functions.softmax(F) * (1 + 2.0**-46))
    patch.setattr(elementary, "add_up", lambda rows: rows.sum(axis=0) * (1 + 2.0**-50))
    patch.setattr(elementary, "add_exactly", lambda total, carry, term: (total + term, carry))

    def from_shares(F: np.ndarray, labels: np.ndarray, weights: np.ndarray | None) -> tuple[np.ndarray, float]:
        P = functions.softmax(F)
        return P, float(np.average(-np.log(np.maximum(P[labels, np.arange(labels.size)], 1e-320)), weights=weights))

    patch.setattr(elementary, "softmax_and_loss", from_shares)


def float_score(table: np.ndarray) -> float:
    return float(
        sum(m * math.log(m) for m in table.ravel() if m) - sum(m * math.log(m) for m in table.sum(axis=0) if m)
    )


def best_in_floats(node: Any, columns: np.ndarray) -> int:
    return int(np.argmax([float_score(node.table(position)) for position in range(len(columns))]))


class Careless(Cooccurrence):
    """Works in single precision, and compares in floating point."""

    def information(self, given: int | None = None) -> np.ndarray:
        return super().information(given).astype(np.float32)

    def sign(self, one: tuple[int, int | None], other: tuple[int, int | None]) -> int:
        return int(np.sign(super().information(one[1])[one[0]] - super().information(other[1])[other[0]]))


def spoil_information(patch: Patch) -> None:
    patch.setattr(information, "gain_bits", lambda table: gain.gain_bits(table) + 1e-13)
    patch.setattr(information, "entropy_bits", lambda totals: gain.entropy_bits(totals) * (1 + 2.0**-45))
    patch.setattr(information, "compare", lambda a, _, b, __: int(np.sign(float_score(a) - float_score(b))))
    patch.setattr(information, "best_position", best_in_floats)
    patch.setattr(information, "Cooccurrence", Careless)


def spoil_targets(patch: Patch) -> None:
    def unclamped(p: np.ndarray, member: np.ndarray, z_max: float, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        own = np.where(member, p, 1.0 - p)
        sizes = np.where(member, 1.0 - p, p) * u
        return sizes * own, np.where(member, sizes, -sizes) * (1 + 2.0**-51)

    def off_the_grids(values: np.ndarray) -> tuple[arithmetic.OnGrid, arithmetic.OnGrid]:
        coarse, fine = arithmetic.on_grids(values)
        return (
            arithmetic.OnGrid(coarse.units + 0.25, coarse.exponents),
            arithmetic.OnGrid(np.rint(fine.units / 4) * 4, fine.exponents),
        )

    patch.setattr(targets, "weights_and_responses", unclamped)
    patch.setattr(targets, "on_grids", off_the_grids)


def spoil_stumpfits(patch: Patch) -> None:
    def off(sets: Any, given: Targets, z_max: float) -> FittedStumps:
        fitted = fit_stumps(sets, given, z_max)
        return replace(fitted, values=fitted.values * (1 + 2.0**-50))

    def one_row_turned(weights: np.ndarray, responses: np.ndarray) -> Targets:
        return Targets(weights, np.where(np.arange(responses.shape[1]) == 0, -responses, responses))

    patch.setattr(stumpfits, "midpoints", lambda values: values[1:])
    patch.setattr(stumpfits, "fit_stumps", off)
    patch.setattr(stumpfits, "Targets", one_row_turned)


def nearer_zero(integers: IntegerTables) -> IntegerTables:
    """Return tables with every entry a step nearer to zero: no sum leaves its range."""
    names = ("bias", "switch_rows", "switch_means", "joint_means")
    return integers.changed(**{name: getattr(integers, name) - np.sign(getattr(integers, name)) for name in names})


def spoil_scoretables(patch: Patch) -> None:
    balance, quantised = quantise.balance, quantise.quantise

    def lost_bits(tables: ScoreTables) -> ScoreTables:
        single = tuple(rows.astype(np.float32).astype(np.float64) for rows in balance(tables).joint_rows)
        return balance(tables).changed(joint_rows=single)

    def off(of: stumps.Stumps, n_switches: int) -> ScoreTables:
        tables = later(of, n_switches)
        return tables.changed(bias=tables.bias * (1 + 2.0**-40))

    patch.setattr(stumps, "centred", lambda answers, shrinkage: answers * shrinkage)
    patch.setattr(scoretables, "collapse", off)
    patch.setattr(scoretables, "balance", lost_bits)
    patch.setattr(scoretables, "quantise", lambda *given: nearer_zero(quantised(*given)))
    patch.setattr(ScoreTables, "scores", lambda self, bits, codes: np.tile(self.bias, (len(bits), 1)))


def spoil_logits(patch: Patch) -> None:
    def early_and_leaning(X: Any, labels: Any, *given: Any, **named: Any) -> ColumnTables:
        found = fit_logit(X, labels, *given, **(named | {"tolerance": 1e-5}))
        return ColumnTables(found.bias * (1 + 2.0**-40 * labels[0]), found.edges, found.rows)

    patch.setattr(logits, "fit_logit", early_and_leaning)
    patch.setattr(logits, "fit_pairs", partial(fit_pairs, tolerance=1e-5))


def spoil_degenerate(patch: Patch) -> None:
    def off(*given: Any, **named: Any) -> Any:
        trained, losses = boost(*given, **named)
        return replace(trained, values=trained.values * (1 + 2.0**-40)), losses

    patch.setattr(degenerate, "boost", off)


def spoil_columns(patch: Patch) -> None:
    patch.setattr(columns, "grow_id3", lambda X, labels: grow_id3(X, np.roll(labels, 1)))


def later(of: stumps.Stumps, n_switches: int) -> ScoreTables:
    """Return the tables of an ensemble with all thresholds one code too high."""
    tables = collapse.collapse(of, n_switches)
    codes = tuple(np.minimum(codes, 65533) + np.uint16(1) for codes in tables.thresholds)
    return tables.changed(thresholds=codes)


class OneTooMuch(Scorer):
    """Adds a step to the score of the first class."""

    def biased_scores(self, *frame: Any) -> Any:
        first, *others = super().biased_scores(*frame)
        return [first + 1, *others]


def spoil_missing(patch: Patch) -> None:
    """Read what is lost, tell nobody, and let nothing stand in for a switch."""
    right = Build.recognise

    def without_replacements(*given: Any, **named: Any) -> Any:
        small = small_build(*given, **named)
        tables = small.build.tables
        return small._replace(build=Build(small.build.manifest, tables.changed(switch_means=0 * tables.switch_means)))

    def nosy(self: Build, *frame: np.ndarray) -> Recognition:
        return msgspec.structs.replace(right(self, *frame[:2]), degraded=False)

    patch.setattr(missing, "small_build", without_replacements)
    patch.setattr(Build, "recognise", nosy)


def spoil_contact(patch: Patch) -> None:
    def off(*given: Any) -> list[Rest]:
        (found,) = close(*given)
        found.angles[9] += 0.005
        return [found]

    patch.setattr(contact, "close", off)


def spoil_statistics(patch: Patch) -> None:
    right = Rate.counted

    def narrow(correct: Any, total: int, **named: Any) -> Rate:
        rate = right(correct, total, **named)
        return replace(rate, low=rate.mean * (1 + 2.0**-40), high=rate.mean)

    patch.setattr(Rate, "counted", narrow)


def spoil_platform(patch: Patch) -> None:
    built = platform.run(platform.AS_IT_IS)

    def differing(setting: platform.PlatformSetting) -> platform.Built | str:
        if setting is platform.AS_IT_IS or isinstance(built, str):
            return built
        (name, _), *others = built.files
        return msgspec.structs.replace(built, files=((name, "0" * 64), *others))

    patch.setattr(platform, "run", differing)


SPOILED: dict[str, tuple[Callable[[Patch], None], tuple[str, ...]]] = {
    "elementary": (spoil_elementary, EVERY),
    "information": (spoil_information, EVERY),
    "targets": (spoil_targets, EVERY),
    "stumpfits": (spoil_stumpfits, EVERY),
    "scoretables": (spoil_scoretables, EVERY),
    "invariances": (
        lambda patch: patch.setattr(invariances, "boost", heavier_row),
        ("rows in another order", "stumps chosen", "outputs of branches"),
    ),
    "separable": (lambda patch: patch.setattr(separable, "boost", heavier_row), ("reported losses",)),
    "logits": (spoil_logits, ("largest derivative at", "largest derivative with pairs", "solutions changed by")),
    "degenerate": (spoil_degenerate, ("first outputs, as many", "first outputs of")),
    "columns": (spoil_columns, ("decisions of ID3", "frames of an XOR")),
    "codes": (lambda patch: patch.setattr(codes, "collapse", later), ("codes on different sides",)),
    "contradictions": (lambda patch: patch.setattr(contradictions, "boost", heavier_row), ("final P",)),
    "weights": (lambda patch: patch.setattr(weights, "boost", heavier_row), ("stumps chosen", "outputs of branches")),
    "quantisation": (lambda patch: patch.setattr(quantisation, "Scorer", OneTooMuch), ("worst frame", "largest loss")),
    "missing": (spoil_missing, ("frames reported as degraded", "outputs that depend on the value of a lost input")),
    "contact": (spoil_contact, ("quasistatic at rest: moment on a joint",)),
    "statistics": (spoil_statistics, ("ends of Wilson's interval", "rates of 0 and 1", "intervals that leave 0 to 1")),
    "platform": (spoil_platform, EVERY),
}


def test_there_is_a_spoiled_input_for_each_case() -> None:
    assert SPOILED.keys() == CASES.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_case_notices_a_fault(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spoil, checks = SPOILED[name]
    spoil(monkeypatch)
    missed = set(checks)
    for finding in load(name).findings(False):
        due = {check for check in checks if finding.check.startswith(check)}
        assert not (due and finding.holds), finding.check
        missed -= due
        if checks != EVERY and not missed:
            break
    assert not missed
