"""Additive models compared with the best alternatives, on the same folds.

    python benchmarks/models.py [--sets aml icub ...] [--models logit "RBF SVM" ...] [--data FOLDER]

Folds separate trials, or subjects; the switches (the first 33 of ID3, or all if there are fewer) are placed inside each
fold, and settings are chosen inside as well. Predictions are kept in --store, so an interrupted run can be resumed.
After a change of code, remove the store. A set may be a .grasps file. Real recordings are read from --data; missing
peers and sets are named and left out. A full run takes hours, `--sets icub aml` takes minutes.
"""

import argparse
import resource
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np
from joblib import Memory
from modelpeers import OURS, PEERS, Classes, Model, recognised
from modelsets import SETS, Cut, cuts, load
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from threadpoolctl import threadpool_limits

from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.workers import in_workers
from thenar.runtime.manifest import Of

CONSOLE = Console(width=150)
MODELS = {model.name: model for model in OURS + PEERS}


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """The predictions of a model for the rows of one fold; `integers` are those of its deployed tables."""

    cpu_s: float
    predictions: Classes
    integers: Classes | None


def predicted(task: tuple[Cut, str]) -> Predicted:
    """Return the predictions of a named model, with the processor time of this process and of its children."""
    cut, name = task
    warnings.filterwarnings("ignore")
    began = process_time() + _of_children()
    with threadpool_limits(1):
        predictions, integers = MODELS[name].predicted(cut)
    return Predicted(process_time() + _of_children() - began, predictions, integers)


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A model on all folds of a set: its rates, whether each trial (T,) is correct, processor seconds."""

    model: Model
    rate: Rate
    integers: Rate | None
    hits: NDArray[np.bool_]
    cpu_s: float


def line_of(model: Model, found: Sequence[Cut], replies: Sequence[Predicted]) -> Line:
    """Return the line of a model's predictions for these folds."""
    labels, trials, subjects = (
        np.concatenate([getattr(cut.test, what) for cut in found]) for what in ("labels", "trials", "subjects")
    )
    of = found[0].of

    def rate(predictions: Sequence[Classes]) -> Rate:
        groups = subjects if of == "new subject" else None
        return Rate.predicted(np.concatenate(predictions), labels, trials, of=of, groups=groups)

    whole = [each.integers for each in replies if each.integers is not None]
    hits = [recognised(each.predictions, cut.test) for each, cut in zip(replies, found, strict=True)]
    integers = rate(whole) if whole else None
    cpu_s = sum(each.cpu_s for each in replies)
    return Line(model, rate([each.predictions for each in replies]), integers, np.concatenate(hits), cpu_s)


def p_value(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """Return McNemar's exact p of two models' trials: a fair coin for each trial that only one predicts correctly."""
    from scipy.stats import binomtest

    only, lost = int((one & ~other).sum()), int((other & ~one).sum())
    return float(binomtest(only, only + lost).pvalue) if only + lost else 1.0


def shown(name: str, of: Of, made: Sequence[Line]) -> Table:
    """Return the table of one set and kind of folds."""
    table = Table(title=f"{name}, {of}: {made[0].rate.total:,} trials")
    for heading in ("", "additive", "settings"):
        table.add_column(heading)
    for heading in ("accuracy, %", "95 %", "as integers, %", "behind the best baseline, points", "p", "CPU, s"):
        table.add_column(heading, justify="right")
    baseline = next((line for line in made if not line.model.ours), None)
    for line in made:
        name, yes, how = line.model.name, "yes" if line.model.additive else "", line.model.how
        of_integers = "" if line.integers is None else f"{100 * line.integers.mean:.2f}"
        within = f"{100 * line.rate.low:.1f} to {100 * line.rate.high:.1f}"
        gap = p = ""
        if baseline is not None and line is not baseline:
            gap = f"{100 * (baseline.rate.mean - line.rate.mean):+.2f}"
            p = f"{p_value(line.hits, baseline.hits):.2g}"
        numbers = (f"{100 * line.rate.mean:.2f}", within, of_integers, gap, p, f"{line.cpu_s:.1f}")
        table.add_row(name, yes, how, *numbers, style="bold" if line.model.ours else "")
    return table


def available(names: Sequence[str]) -> Iterator[Model]:
    """Yield those of the named models whose requirements are installed."""
    for model in MODELS.values():
        if model.name in names and model.there:
            yield model
        elif model.name in names:
            CONSOLE.print(f"left out: {model.name}: no {model.needs}")


def folds(names: Sequence[str], data: Path) -> Iterator[tuple[str, Of, list[Cut]]]:
    """Yield each available set and kind of folds, with its folds."""
    for name in names:
        try:
            found = list(cuts(load(name, data)))
        except FileNotFoundError as reason:
            CONSOLE.print(f"left out: {name}: {reason}")
            continue
        for of in dict.fromkeys(cut.of for cut in found):
            yield name, of, [cut for cut in found if cut.of == of]


def main() -> None:
    """Compute the predictions that are not in the store, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="+", default=SETS, help=f"of {', '.join(SETS)}, or .grasps files")
    parser.add_argument("--models", nargs="+", default=list(MODELS), help="of " + ", ".join(MODELS))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real recordings")
    parser.add_argument("--store", type=Path, default=Path("build/models"), help="folder of the predictions")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    models, work = list(available(options.models)), list(folds(options.sets, options.data))
    recalled = Memory(options.store, verbose=0).cache(predicted)
    tasks = [(cut, model.name) for model in models for _, _, found in work for cut in found]
    tasks = [task for task in tasks if not recalled.check_call_in_cache(task)]
    columns = (TextColumn("folds"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True, width=110)) as bar:
        for _ in bar.track(in_workers(recalled, tasks, options.jobs), total=len(tasks)):
            pass
    for name, of, found in work:
        lines = [line_of(model, found, [recalled((cut, model.name)) for cut in found]) for model in models]
        CONSOLE.print(shown(name, of, sorted(lines, key=lambda each: -each.rate.mean)))


if __name__ == "__main__":
    main()
