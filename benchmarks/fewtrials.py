"""Additive models and others where trials are few: sets cut to 3, 5 and 8 trials of each type, five draws of each.

    python benchmarks/fewtrials.py [--models auto "extra trees" ...] [--data FOLDER]

Every model is trained on a draw and tested on the other trials of its set, at most 700. The switches are placed inside
the draw, and so are settings chosen. The bound is how far `auto` may be behind the best single model, by its mean.
"""

import argparse
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from modelpeers import OURS, PEERS, Model, recognised
from modelsets import Cut, load, with_switches
from rich.console import Console
from rich.progress import track
from rich.table import Table
from threadpoolctl import threadpool_limits

from thenar.compiler.samples import Samples
from thenar.runtime.recipe import AUTO

SETS, TRIALS, DRAWS, MOST_TESTED = ("icub", "aml", "kamakura"), (3, 5, 8), 5, 700
BEHIND = 1.0  # points
SLOW = ("EBM", "EBM with pairs", "Weka LogitBoost")


def drawn(samples: Samples, trials: int) -> Iterator[Cut]:
    """Yield draws of this many trials of each type, and the other trials; each trial of these sets is a row."""
    for draw in range(DRAWS):
        random = np.random.default_rng([trials, draw])
        places = [np.flatnonzero(samples.labels == label) for label in range(samples.n_classes)]
        chosen = np.sort(np.concatenate([random.permutation(rows)[:trials] for rows in places]))
        others = random.permutation(np.setdiff1d(np.arange(len(samples.labels)), chosen))[:MOST_TESTED]
        train, test = samples.rows(chosen), samples.rows(np.sort(others))
        yield with_switches("pooled", f"draw {draw + 1}", train, test, train.trials)


def rates(model: Model, cells: dict[tuple[str, int], list[Cut]]) -> list[float]:
    """Return the mean accuracy in % over the draws of each set and number of trials."""
    found = []
    for draws in cells.values():
        hits = [recognised(model.predicted(cut)[0], cut.test).mean() for cut in draws]
        found.append(100 * float(np.mean(hits)))
    return found


def main() -> None:
    """Print the table, and whether `auto` keeps the bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [model.name for model in OURS + PEERS if model.name not in SLOW]
    parser.add_argument("--models", nargs="+", default=names, help="of " + ", ".join(names))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real recordings")
    asked, console = parser.parse_args(), Console(width=150)
    warnings.filterwarnings("ignore")
    sets = {name: load(name, asked.data) for name in SETS}
    cells = {(name, trials): [*drawn(sets[name], trials)] for name in SETS for trials in TRIALS}
    models = [model for model in OURS + PEERS if model.name in asked.models]
    with threadpool_limits(1):
        found = [(model, rates(model, cells)) for model in track(models, "models", console=Console(stderr=True))]
    table = Table(title="Few trials: accuracy on other trials of the same people, %, mean of five draws")
    table.add_column("trials of each type")
    for name, trials in cells:
        table.add_column(f"{name} {trials}", justify="right")
    table.add_column("mean", justify="right")
    for model, row in sorted(found, key=lambda item: -np.mean(item[1])):
        cells_of = (*(f"{rate:.1f}" for rate in row), f"{np.mean(row):.2f}")
        table.add_row(model.name, *cells_of, style="bold" if model.ours else "")
    console.print(table)
    others = [float(np.mean(row)) for model, row in found if not model.ours]
    ours = [float(np.mean(row)) for model, row in found if model.name == AUTO]
    if ours and others:
        gap = max(others) - ours[0]
        console.print(f"auto is {gap:+.2f} points behind the best single model: {'yes' if gap <= BEHIND else 'NO'}")


if __name__ == "__main__":
    main()
