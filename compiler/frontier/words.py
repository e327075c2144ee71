"""A frontier in words: names of its points, the sentence that sums it up, and `frontier.csv`."""

import csv
import io
from collections.abc import Callable, Iterable

import numpy as np

from thenar.runtime.names import printable, taxel_and_code
from thenar.runtime.recipe import PAPERS_TRAINER

from ..evaluation.rates import Rate, interval
from ..facts import SensorCount
from ..placement.sensors import SENSORS
from ..text import cells, counted, duration, listed, percent
from .points import Frontier, FrontierPoint, PointSetting, PointTime, ReferencePoint, front

_LONGEST = 40  # letters of a name on a picture
_SPARED = 0.005  # rates within half a point count as equal


def inputs_of(frontier: Frontier, point: FrontierPoint) -> str:
    """Return the inputs of a point: "33 of 160 switches and 16 of 16 joints", "6 of 24 pads (14 levels)"."""
    setting = point.setting
    taxels = [level[0] for name in point.switches if setting.levels is not None and (level := taxel_and_code(name))]
    switches, kept, inputs = len(point.switches) - len(taxels), len(set(taxels)), setting.inputs
    count = SensorCount(
        switches=(switches, frontier.n_switches) if inputs != "joints" else (0, 0),
        pads=(kept, frontier.n_taxels) if inputs != "joints" else (0, 0),
        joints=(len(point.joints) or frontier.n_joints, frontier.n_joints) if inputs != "switches" else (0, 0),
        levels=len(taxels),
    )
    return str(count)


def elements_of(frontier: Frontier) -> str:
    """Return the name of the kept elements: switches, levels, or, for both, elements."""
    if not frontier.n_taxels:
        return "switches"
    return "elements" if frontier.n_switches else "levels"


def rough_of(frontier: Frontier) -> str:
    """Return the front of what was tried, by accuracy against frame time, in a few words each: at most eight."""
    best = front(frontier.tried, lambda one: one.frame_us, lambda one: one.rate.mean)
    shown = [best[round(place)] for place in np.linspace(0, len(best) - 1, min(len(best), 8))]
    return ", ".join(f"{percent(one.rate.mean)} in {duration(one.frame_us)}" for one in shown)


def counted_of(frontier: Frontier) -> str:
    """Return the name of what the size of a point counts: sensors if these were chosen, else its elements."""
    return "sensors" if any(one.placement.method == SENSORS for one in frontier.tried) else elements_of(frontier)


def counted_elements(frontier: Frontier, count: int) -> str:
    """Return a number of elements in words: "33 switches", "1 level"."""
    several = elements_of(frontier)
    return counted(count, several.removesuffix("es" if several == "switches" else "s"), several)


def shorten(name: str) -> str:
    """Return a name that fits on a picture: one line of at most 40 letters, all valid in XML."""
    line = printable(" ".join(name.split()))
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 3]}..."


def way_of(setting: PointSetting) -> str:
    """Return how switches were chosen: "id3 62", "id3 62, 3 levels"."""
    levels = "" if setting.levels is None else f", {counted(setting.levels, 'level')}"
    return f"{setting.placement.method} {setting.placement.parameter:g}{levels}"


def training_of(setting: PointSetting) -> str:
    """Return the training in words, without the paper's trainer: "100 rounds", "naive-bayes, joint-bins 5"."""
    name = () if setting.trainer == PAPERS_TRAINER else (setting.trainer,)
    rounds = () if setting.rounds is None else (counted(setting.rounds, "round"),)
    return ", ".join((*name, *rounds, *setting.settings_in_words))


def trainer_of(setting: PointSetting) -> str:
    """Return trainer and settings, including the paper's trainer: "logitboost, 100 rounds"."""
    return f"{setting.trainer}, {training_of(setting)}" if setting.trainer == PAPERS_TRAINER else training_of(setting)


def wiring_of(setting: PointSetting) -> str:
    """Return wiring and clock: "mcp23017 400 kHz", "board 1 Mbaud"; "" if no switch is read."""
    if not setting.clock_hz:
        return ""
    unit = "baud" if setting.wiring == "board" else "Hz"
    for letter, size in (("M", 1_000_000), ("k", 1_000)):
        if setting.clock_hz >= size:
            return f"{setting.wiring} {setting.clock_hz / size:g} {letter}{unit}"
    return f"{setting.wiring} {setting.clock_hz} {unit}"


def featured(frontier: Frontier) -> FrontierPoint | None:
    """Return the featured point, or None: the picked one; else the fastest whose accuracy is within half a point of the
    mark of most switches, the first of equals; else the best.
    """
    if frontier.picked is not None:
        return frontier.point(frontier.picked)
    goal = max(frontier.marks, key=lambda mark: mark.n_switches, default=None)
    level = [each for each in frontier.points if goal is not None and each.rate.mean >= goal.rate.mean - _SPARED]
    if level:
        return min(level, key=lambda each: (each.frame.us, -each.rate.mean, each.number))
    return max(frontier.points, key=lambda each: (each.rate.mean, -each.frame.us, -each.number), default=None)


def summary(frontier: Frontier) -> str:
    """Return switches, time and accuracy of the featured point, compared with the marks, in a sentence."""
    point = featured(frontier)
    if point is None:
        return f"Of {frontier.combinations:,} combinations none is a point of the frontier."
    trained = f", trained by {trainer_of(point.setting)}," if len(frontier.trainers) > 1 else ","
    said = (
        f"Point {point.number}: {inputs_of(frontier, point)}{trained} read and classified in "
        f"{duration(point.frame.us)} on {frontier.machine}, reach {interval(point.rate)} % accuracy ({point.rate.what})"
    )
    against = [
        f"{percent(mark.rate.mean)} in {duration(mark.frame_us)} with {mark_name(mark, frontier)}"
        for mark in frontier.marks
    ]
    said += f", against {listed(against)}." if against else "."
    if round(100 * point.luck, 1):
        said += (
            f" Cross-validation gave {percent(point.rate.mean + point.luck)}; {100 * point.luck:.1f} points are "
            "subtracted, because the best of many is picked by its luck, too."
        )
    return said


LUCK = (
    "A point is the best of many, so its rate is corrected for luck by a bootstrap over everything tried; the rates of "
    "marks and of placements as they were screened are not."
)


def folds_of(frontier: Frontier) -> str:
    """Return the protocol of the rates by which points are chosen: "new subject: each of 3 subjects left out"."""
    if frontier.by == "new subject":
        return f"New subject, trials: the {counted(frontier.subjects, 'subject')} left out in turn"
    repeats = counted(frontier.repeats, "repeat")
    return f"Pooled, trials: {counted(frontier.folds, 'fold')} of whole trials, {repeats}"


def remarks_on_rates(frontier: Frontier) -> str:
    """Return sentences on the correction of rates for luck, and on own trials."""
    adapting = (
        f" The first {counted(frontier.own_trials, 'trial')} of each type of a left-out subject adapt the model. The "
        "rates before and after that are of the subject's other trials, and are not corrected."
    )
    return LUCK + (adapting if frontier.own_trials else "")


def rates_of(frontier: Frontier) -> dict[str, Callable[[FrontierPoint], Rate | None]]:
    """Return the kinds of rates of a point with their getters, first the one by which points are chosen; of trials
    unless the kind says frames.
    """
    found: dict[str, Callable[[FrontierPoint], Rate | None]] = {frontier.by: lambda point: point.rate}
    if any(point.frames is not None for point in frontier.points):
        found[f"{frontier.by}, frames"] = lambda point: point.frames
    if frontier.other is not None:
        found[frontier.other] = lambda point: point.other_rate
    if frontier.own_trials:
        found["before own trials"] = lambda point: point.adapted and point.adapted[0]
        found[f"after {counted(frontier.own_trials, 'own trial')}"] = lambda point: point.adapted and point.adapted[1]
    return found


def mark_name(mark: ReferencePoint, frontier: Frontier) -> str:
    """Return a mark's name with its number of elements: "all 160 switches", "35 switches (paper, S = 62)"."""
    named = str(mark.n_switches) in mark.name
    return mark.name if named else f"{counted_elements(frontier, mark.n_switches)} ({mark.name})"


def of_time(frontier: Frontier, what: str) -> str:
    """Return the name of a column or an axis of times: "frame", or "frame (guess)"."""
    return f"{what} (guess)" if frontier.guessed else what


def csv_bytes(frontier: Frontier) -> bytes:
    """Return `frontier.csv`: UTF-8, a line of names, and a line for each point.

    The columns of trainer and settings are only there if a point's are not the defaults. Rates are in 0..1, times in
    microseconds; all rates but `rate` may be empty. `fronts`, `switches` and `settings` are lists within a cell,
    separated by semicolons; names with a semicolon or a quote are quoted as in CSV.
    """
    file = io.StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    rows = [_cells(point) for point in frontier.points]
    if not all(point.setting.usual for point in frontier.points):
        for row, point in zip(rows, frontier.points, strict=True):
            row.update(trainer=point.setting.trainer, settings=_list(point.setting.settings_in_words))
    writer.writerows(list(row) for row in rows[:1])
    writer.writerows(cells(row.values()) for row in rows)
    return file.getvalue().encode()


def _cells(point: FrontierPoint) -> dict[str, object]:
    setting, placement = point.setting, point.setting.placement
    row: dict[str, object] = {"number": point.number, "fronts": _list(point.fronts), "n_switches": len(point.switches)}
    row |= {"inputs": setting.inputs, "method": placement.method, "parameter": placement.parameter}
    row |= {"rounds": setting.rounds, "width": setting.width, "wiring": setting.wiring, "clock_hz": setting.clock_hz}
    before, after = point.adapted or (None, None)
    kinds = {"rate": point.rate, "frames": point.frames, "other_rate": point.other_rate}
    for name, rate in (kinds | {"before_adaptation": before, "after_adaptation": after}).items():
        numbers = ("", "", "", "") if rate is None else (rate.what, rate.mean, rate.low, rate.high)
        row |= zip((f"{name}_of", name, f"{name}_low", f"{name}_high"), numbers, strict=True)
        if name == "rate":
            row["luck"] = point.luck
    for name in ("scan", "transfer", "classify", "frame"):
        time: PointTime = getattr(point, name)
        row |= {f"{name}_us": time.us, f"{name}_how": time.how}
    row |= {"flash": point.flash, "ram": point.ram, "ports": point.ports, "chips": point.chips}
    return row | {"switches": _list(point.switches), "joints": _list(point.joints)}


def _list(names: Iterable[str]) -> str:
    listed = io.StringIO(newline="")
    csv.writer(listed, delimiter=";", lineterminator="").writerow(names)
    return listed.getvalue()
