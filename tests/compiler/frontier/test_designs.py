"""Designs of a finalist, made up by hand: what they take, and what becomes of them as points."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.frontier.designs import Design, best_designs, designs_of, lucks, points_of
from thenar.compiler.frontier.finalists import EvaluatedFinalist, Screened
from thenar.compiler.frontier.points import PointTime
from thenar.compiler.frontier.price import Classified, PricedTables
from thenar.compiler.frontier.search import Search, placed, tabled
from thenar.compiler.frontier.survey import Cuts, TrialAccuracy
from thenar.compiler.frontier.wirings import ScanTimes, records_of
from thenar.compiler.placement.elements import Element
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import TRAINERS, Training
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.recipe import PAPERS_TRAINER, Recipe


@dataclass
class Surveyed:
    """What points ask a survey for."""

    chosen: Training | None = None

    def names(self, recipe: Recipe) -> tuple[str, ...]:
        return tuple(f"s{number}" for number in range(recipe.prune))

    def some_joints(self, recipe: Recipe) -> tuple[str, ...]:
        return ()

    def training(self, recipe: Recipe) -> Training:
        return self.chosen or Search().alone(recipe.trainer).training


SURVEY: Any = Surveyed()


def judged(rate: float) -> TrialAccuracy:
    return TrialAccuracy(
        Rate.counted((round(1000 * rate),), 1000, of="pooled"), (np.arange(1000) < 1000 * rate).astype(np.intp), 1
    )


def close_of(
    switches: int = 20, rate: float = 0.9, scan_us: float = 500.0, classify_us: float = 50.0
) -> EvaluatedFinalist:
    recipe = placed("id3", switches, PAPERS_TRAINER, "switches" if switches else "joints")
    scans = (ScanTimes("mcp23017", 400_000, scan_us, 4, 2, "wire"),) if switches else ()
    tables = PricedTables(tabled(recipe, 10), b"", Classified(classify_us, "model", 900, 30), scans)
    screened = Screened(recipe, tuple(map(Element, range(switches))), judged(rate), classify_us)
    return EvaluatedFinalist(screened, {}, {tables.recipe: judged(rate)}, {}, {}, (tables,))


def simulated(design: Design, us: float) -> Design:
    return replace(design, measured=PointTime(us, "simulated"))


def test_joints_alone_have_one_design_and_wait_for_a_record() -> None:
    (design,) = designs_of(close_of(switches=0), records_of(SENSORS_18).of(18))
    assert (design.scan.us, design.wired, design.classify.us) == (0.0, None, 50.0)
    assert design.frame.us == pytest.approx(18 * 250 + 21 * 10 / 115_200 * 1e6 + 50.0)


def test_luck_is_the_same_however_often_the_same_folds_are_repeated() -> None:
    """Each trial that is recognised is, in every repeat; the luck is of a share of trials all the same."""
    search = Search(methods=("id3",))
    survey: Any = SimpleNamespace(search=search, cuts=Cuts.of(samples_of_trials(200), search))
    found = []
    for repeats in (1, 3):
        random = np.random.default_rng(1)
        several = []
        for switches in range(1, 9):
            close = close_of(switches, 0.9, classify_us=50.0 + switches)
            hits = (random.random(200) < 0.8).astype(np.intp)
            judged_so = TrialAccuracy(Rate.counted((int(hits.sum()),), 200, of="pooled"), repeats * hits, repeats)
            close = replace(
                close, tables=dict.fromkeys(close.tables, judged_so), screened=replace(close.screened, judged=judged_so)
            )
            several.append(next(designs_of(close)))
        found.append(sorted(lucks(several, [], survey).values()))
    assert found[0] == pytest.approx(found[1])
    assert found[0][-1] > 0.001


def samples_of_trials(trials: int) -> Samples:
    return Samples(np.zeros((trials, 1), bool), np.zeros((trials, 0), np.uint16), np.arange(trials) % 2, ("a", "b"))


def test_fronts_hold_the_quickest_and_the_smallest() -> None:
    big, small = close_of(30, 0.95, scan_us=100.0), close_of(5, 0.9, scan_us=400.0)
    by_time, by_switches = best_designs([*designs_of(small), *designs_of(big)])
    assert [design.size for design in by_time] == [30]
    assert [design.size for design in by_switches] == [5, 30]


def test_points_are_ordered_and_on_fronts_by_what_was_simulated() -> None:
    one, other = next(designs_of(close_of(20, 0.9))), next(designs_of(close_of(10, 0.8, classify_us=30.0)))
    # The model has the other one faster, the simulator the better one: so the other is beaten on time.
    assert other.frame.us < one.frame.us
    several = [simulated(one, 20.0), simulated(other, 60.0)]
    points = points_of(several, {each.judged: 0.01 for each in several}, {}, SURVEY)
    assert [point.frame.us for point in points] == sorted(point.frame.us for point in points)
    fronts = {len(point.switches): point.fronts for point in points}
    assert fronts == {20: ("frame", "switches"), 10: ("switches",)}
    assert points[0].classify == PointTime(20.0, "simulated")


def test_luck_lowers_a_points_rate_and_its_intervals_lower_end() -> None:
    design = next(designs_of(close_of(20, 0.9)))
    (point,) = points_of([design], {design.judged: 0.25}, {}, SURVEY)
    found = design.judged.rate
    assert (point.rate.mean, point.rate.low, point.rate.high) == pytest.approx(
        (found.mean - 0.25, found.low - 0.25, found.high)
    )
    assert (point.luck, point.rate.correct) == (0.25, found.correct)


def test_a_point_says_its_trainer_and_every_setting_that_is_no_default() -> None:
    (design,) = designs_of(close_of())
    usual = {own.name: own.default for own in TRAINERS["logit"].settings}
    chosen = Training("logit", {**usual, "penalty": 17.0, "max_bins": 8})
    surveyed: Any = Surveyed(chosen)
    (point,) = points_of([design], {design.judged: 0.0}, {}, surveyed)
    setting = point.setting
    assert (setting.trainer, setting.settings, setting.max_bins, setting.rounds) == (
        "logit",
        {"penalty": 17.0},
        8,
        None,
    )
