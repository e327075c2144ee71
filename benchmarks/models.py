"""Additive models compared with the best alternatives, on the same folds.

    python benchmarks/models.py [--sets aml icub ...] [--models logit "RBF SVM" ...] [--data FOLDER]

Folds separate trials, or subjects; the switches (the first 33 of ID3, or all if there are fewer) are placed inside each
fold, and settings are chosen inside as well. Predictions are kept in --store, so an interrupted run can be resumed.
After a change of code or of a set, remove the store. A set may be a .grasps file. Real recordings are read from --data;
missing peers and sets are named and left out. A full run takes hours, `--sets icub aml` takes minutes.
"""

import argparse
import resource
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import msgspec
import numpy as np
from modelpeers import OURS, PEERS, Model, recognised
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
# The lead allowed to a baseline.
WITHIN = 0.5


class Predicted(msgspec.Struct, frozen=True, rename={"predictions": "answers"}):  # codespell:ignore answers
    """The predictions of a model for the rows of one fold, in order; `integers` are those of its deployed tables."""

    set: str
    of: Of
    fold: str
    model: str
    cpu_s: float
    predictions: list[int]
    integers: list[int] | None = None

    @property
    def key(self) -> tuple[str, str, str, str]:
        """The key under which it is stored."""
        return self.set, self.of, self.fold, self.model


Task = tuple[str, Cut, Model]
Cuts = dict[str, list[Cut]]
Store = dict[tuple[str, str, str, str], Predicted]


def predicted(task: Task) -> Predicted:
    """Return a model's predictions, with the processor time of this process and of its children."""
    name, cut, model = task
    warnings.filterwarnings("ignore")
    began = process_time() + _of_children()
    with threadpool_limits(1):
        predictions, integers = model.predicted(cut)
    spent = process_time() + _of_children() - began
    whole = None if integers is None else integers.tolist()
    return Predicted(name, cut.of, cut.name, model.name, round(spent, 3), predictions.tolist(), whole)


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def stored(path: Path) -> Store:
    """Return the predictions stored earlier."""
    lines = path.read_bytes().splitlines() if path.exists() else []
    return {each.key: each for each in map(msgspec.json.Decoder(Predicted).decode, lines)}


def fill(store: Store, path: Path, work: Cuts, models: Sequence[Model], jobs: int) -> None:
    """Compute the predictions that are not in the store, and add them."""
    tasks = [
        (name, cut, model)
        for model in models
        for name, found in work.items()
        for cut in found
        if (name, cut.of, cut.name, model.name) not in store
    ]
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    path.parent.mkdir(parents=True, exist_ok=True)
    with Progress(*columns, console=Console(stderr=True, width=110)) as bar, path.open("ab") as file:
        line = bar.add_task("folds", total=len(tasks))
        for each in in_workers(predicted, tasks, jobs):
            file.write(msgspec.json.encode(each) + b"\n")
            file.flush()
            store[each.key] = each
            bar.update(line, advance=1, description=f"{each.model}, {Path(each.set).stem}")


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A model on all folds of a set: its rates, whether each trial (T,) is correct, processor seconds."""

    model: Model
    rate: Rate
    integers: Rate | None
    hits: NDArray[np.bool_]
    cpu_s: float


def lines(name: str, found: Sequence[Cut], models: Sequence[Model], store: Store) -> list[Line]:
    """Return a line for each model with predictions for all of these folds, the best first."""
    made = []
    for model in models:
        stored_ones = [store.get((name, cut.of, cut.name, model.name)) for cut in found]
        if all(stored_ones):
            made.append(_line(model, found, [each for each in stored_ones if each is not None]))
    return sorted(made, key=lambda line: -line.rate.mean)


def _line(model: Model, found: Sequence[Cut], stored_ones: Sequence[Predicted]) -> Line:
    labels, trials, subjects = (
        np.concatenate([getattr(cut.test, what) for cut in found]) for what in ("labels", "trials", "subjects")
    )
    of = found[0].of

    def rate(predictions: Sequence[list[int]]) -> Rate:
        groups = subjects if of == "new subject" else None
        return Rate.predicted(np.concatenate(predictions), labels, trials, of=of, groups=groups)

    whole = [each.integers for each in stored_ones if each.integers is not None]
    hits = [
        recognised(np.array(each.predictions, np.intp), cut.test) for each, cut in zip(stored_ones, found, strict=True)
    ]
    integers = rate(whole) if len(whole) == len(stored_ones) else None
    cpu_s = sum(each.cpu_s for each in stored_ones)
    return Line(model, rate([each.predictions for each in stored_ones]), integers, np.concatenate(hits), cpu_s)


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
        gap, p = ("", "") if baseline is None or line is baseline else _against(line, baseline)
        numbers = (f"{100 * line.rate.mean:.2f}", within, of_integers, gap, p, f"{line.cpu_s:.1f}")
        table.add_row(name, yes, how, *numbers, style="bold" if line.model.ours else "")
    return table


def _against(line: Line, baseline: Line) -> tuple[str, str]:
    return f"{100 * (baseline.rate.mean - line.rate.mean):+.2f}", f"{p_value(line.hits, baseline.hits):.2g}"


def summary(every: dict[tuple[str, Of], list[Line]], name: str) -> Table:
    """Return the lead of the best baseline over model `name` on each set, and the best additive baseline."""
    table = Table(title=f"{name}: within {WITHIN} points of the best baseline, ahead of every additive one?")
    for heading in (
        "set",
        "",
        f"{name}, %",
        "best baseline, %",
        "",
        "behind",
        "best additive baseline, %",
        "",
        "ahead",
    ):
        table.add_column(heading, justify="right" if heading.endswith(("%", "behind", "ahead")) else "left")
    for (which, of), made in every.items():
        mine = next((line for line in made if line.model.name == name), None)
        baselines = [line for line in made if not line.model.ours]
        additive = [line for line in baselines if line.model.additive]
        if mine is None or not additive:
            continue
        cells = [which, of, f"{100 * mine.rate.mean:.2f}"]
        for baseline, sign in ((baselines[0], 1), (additive[0], -1)):
            gap = 100 * sign * (baseline.rate.mean - mine.rate.mean)
            met = gap <= WITHIN if sign > 0 else gap >= 0
            cells += [f"{100 * baseline.rate.mean:.2f}", baseline.model.name, f"{gap:+.2f} {'yes' if met else 'NO'}"]
        table.add_row(*cells)
    return table


def asked() -> argparse.Namespace:
    """Return the command line options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="+", default=SETS, help=f"of {', '.join(SETS)}, or .grasps files")
    parser.add_argument("--models", nargs="+", help="of " + ", ".join(model.name for model in OURS + PEERS))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real recordings")
    parser.add_argument("--store", type=Path, default=Path("build/models.jsonl"))
    parser.add_argument("--jobs", type=int, default=1)
    return parser.parse_args()


def worked(options: argparse.Namespace) -> Cuts:
    """Return the folds of each available set."""
    work: Cuts = {}
    for name in options.sets:
        try:
            work[name] = list(cuts(load(name, options.data)))
        except FileNotFoundError as reason:
            CONSOLE.print(f"left out: {name}: {reason}")
    return work


def wanted(options: argparse.Namespace) -> Iterator[Model]:
    """Yield the requested models that are available."""
    for model in OURS + PEERS:
        if options.models is not None and model.name not in options.models:
            continue
        if model.there:
            yield model
        else:
            CONSOLE.print(f"left out: {model.name}: no {model.needs}")


def main() -> None:
    """Compute the predictions, and print the tables."""
    options = asked()
    models, work = list(wanted(options)), worked(options)
    store = stored(options.store)
    fill(store, options.store, work, models, options.jobs)
    every = {}
    for name, found in work.items():
        for of in dict.fromkeys(cut.of for cut in found):
            part = [cut for cut in found if cut.of == of]
            every[name, of] = lines(name, part, models, store)
            CONSOLE.print(shown(name, of, every[name, of]))
    for model in models:
        if model.ours:
            CONSOLE.print(summary(every, model.name))


if __name__ == "__main__":
    main()
