"""Which sensors to keep: the floating search and other methods, on the same folds, one pool of all kinds of sensors.

    thenar import examples/home_glove.csv -o home.grasps --yes
    python benchmarks/sensors.py [--sets kamakura ...] [--by trial subject] [--data FOLDER]

Sensors are chosen inside 4 folds by trial, or up to 6 groups of people, from at most 1,100 rows. Then one logistic
regression, whose C is chosen by inner folds, is tested on at most 1,500 other rows. Methods for bits get switches,
levels of pads, and joints as 7 bits each; a sensor is as good as its best bit. The gap is to the best method of a cell.
"""

import argparse
import warnings
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
from modelsets import load
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table
from sklearn.ensemble import RandomForestClassifier
from sklearn.feature_selection import RFE
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from thenar.compiler.evaluation.folds import Fold, leave_one_out, trial_folds
from thenar.compiler.placement.elements import bits_of, elements_of
from thenar.compiler.placement.methods.base import METHODS, PAPERS
from thenar.compiler.placement.methods.elimination import thermometer
from thenar.compiler.placement.sensors import SensorSearch
from thenar.compiler.samples import Columns, Samples

ROWS, TESTED, SEED, CS = 1100, 1500, 1, (0.1, 1.0, 10.0)
SIZES = (4, 8, 12, 16)
# Name, set, kinds of inputs, and how many of them are kept.
CELLS = {
    "kamakura, switches": ("kamakura", "switches", SIZES),
    "kamakura": ("kamakura", "both", SIZES),
    "cutkosky, switches": ("cutkosky", "switches", SIZES),
    "icub": ("icub", "both", SIZES),
    "r2g": ("r2g", "both", SIZES[:3]),
    "aml": ("aml", "both", (2, 3, 4)),
    "home, pads": ("home", "switches", SIZES),
}
MEAN_GAP, WORST_GAP, SECONDS = 1.0, 4.0, 3.0
LEAST_PEOPLE = 3
Chosen = dict[int, Columns]
Method = Callable[[Samples, tuple[int, ...]], Chosen]


def cuts(samples: Samples, by: str) -> Iterator[tuple[Samples, Samples]]:
    """Yield the rows to choose from and those to test on, of the folds by trial, or by groups of people."""
    folds: list[Fold] = trial_folds(samples.labels, samples.trials, 4, SEED)
    if by == "subject":
        people = np.unique(samples.subjects)
        group = np.random.default_rng(SEED).permutation(len(people)) % 6
        folds = leave_one_out(group[np.searchsorted(people, samples.subjects)].astype(np.str_), "subject")
    for number, fold in enumerate(folds):
        random = np.random.default_rng([SEED, number])
        train, test = (
            np.sort(random.permutation(rows)[:most]) for rows, most in ((fold.train, ROWS), (fold.test, TESTED))
        )
        yield samples.rows(train), samples.rows(test)


def floating(samples: Samples, sizes: tuple[int, ...]) -> Chosen:
    """Return the sensors of thenar's search."""
    sets = SensorSearch(samples).sets(max(sizes))
    return {size: sets[min(size, max(sets))].sensors for size in sizes}


def by_bits(name: str) -> Method:
    """Return a placement method, which chooses bits, as one that chooses sensors."""

    def choose(samples: Samples, sizes: tuple[int, ...]) -> Chosen:
        elements, wide = elements_of(samples), samples.n_switches + samples.taxels.shape[1]
        joints = [thermometer(samples.codes[:, [joint]]) for joint in range(samples.codes.shape[1])]
        sensor_of = [element.column for element in elements]
        sensor_of += [wide + joint for joint, bits in enumerate(joints) for _ in bits]
        bits = np.hstack([bits_of(samples, elements).switches, *(each.T for each in joints)])
        pool = replace(samples, switches=bits, taxels=samples.taxels[:, :0], codes=samples.codes[:, :0])
        method = METHODS[name]
        chooser = method.chooser(pool)

        def kept(parameter: int) -> Columns:
            return tuple(dict.fromkeys(sensor_of[bit] for bit in chooser(parameter)))

        if method.by_number:
            order = kept(len(sensor_of))
            return {size: order[:size] for size in sizes}
        least = range(len(samples.labels) + 2)
        # The least S that leaves so few sensors.
        return {size: kept(bisect_left(least, -size, key=lambda s: -len(kept(s)))) for size in sizes}

    return choose


def rfe(samples: Samples, sizes: tuple[int, ...]) -> Chosen:
    """Return the sensors that recursive elimination with a forest keeps."""
    X = values(samples)
    rank = RFE(RandomForestClassifier(100, random_state=SEED), n_features_to_select=1, step=0.1).fit(X, samples.labels)
    order = np.argsort(rank.ranking_, kind="stable")
    return {size: tuple(order[:size].tolist()) for size in sizes}


OURS, ELIMINATION = "floating search (thenar)", "elimination"
METHODS_COMPARED: dict[str, Method] = {
    OURS: floating,
    ELIMINATION: by_bits("elimination"),
    "RFE with forest": rfe,
    "cmim": by_bits("cmim"),
    "mutual information": by_bits("mutual-information"),
    "the paper's ID3, pruned": by_bits(PAPERS),
    "random": by_bits("random"),
}


def values(samples: Samples) -> NDArray[np.float64]:
    """Return all inputs (n, sensors) as numbers."""
    return np.hstack([samples.switches, samples.taxels, samples.codes]).astype(np.float64)


def accuracy(train: Samples, test: Samples, sensors: Columns) -> float:
    """Return the share of test rows that a logistic regression of these sensors recognises."""
    columns = sorted(sensors)
    if not columns:
        return float((test.labels == train.most_frequent).mean())
    inner = [(fold.train, fold.test) for fold in trial_folds(train.labels, train.trials, 3, SEED)]
    model = make_pipeline(StandardScaler(), LogisticRegression(max_iter=300, tol=1e-3))
    chosen = GridSearchCV(model, {"logisticregression__C": CS}, cv=inner).fit(values(train)[:, columns], train.labels)
    return float(chosen.score(values(test)[:, columns], test.labels))


# A set of CELLS, what folds leave out, and how many sensors are kept; and the accuracies of each method there, in %.
Key = tuple[str, str, int]
Rates = dict[str, dict[Key, float]]


def measured(cell: str, by: Sequence[str], asked: argparse.Namespace, spent: dict[str, float]) -> Rates:
    """Return the rates of a set; `spent` keeps the most seconds of CPU that a method took for a fold."""
    name, kinds, sizes = CELLS[cell]
    samples = load(str(asked.home) if name == "home" else name, asked.data).without_none()
    samples = samples.with_joints(()) if kinds == "switches" else samples
    hits: dict[str, dict[Key, list[float]]] = {method: {} for method in METHODS_COMPARED}
    several = len(np.unique(samples.subjects)) >= LEAST_PEOPLE
    folds = [(each, cut) for each in by if several or each == "trial" for cut in cuts(samples, each)]
    for kind, (train, test) in folds:
        for method, choose in METHODS_COMPARED.items():
            began = process_time()
            chosen = choose(train, sizes)
            spent[method] = max(spent[method], process_time() - began)
            for size in sizes:
                hits[method].setdefault((cell, kind, size), []).append(accuracy(train, test, chosen[size]))
    return {method: {key: 100 * float(np.mean(each)) for key, each in found.items()} for method, found in hits.items()}


def table_of(by: str, rates: Rates, spent: dict[str, float]) -> Table:
    """Return the table of one kind of folds, with the gaps to the best method of each cell."""
    keys = [key for key in rates[OURS] if key[1] == by]
    cells = dict.fromkeys(cell for cell, *_ in keys)
    table = Table("method", *cells, "mean gap", "worst", "s", title=f"by {by}, %")
    for method, found in rates.items():
        gaps = gaps_of(method, keys, rates)
        shown = (" / ".join(f"{found[key]:.1f}" for key in keys if key[0] == cell) for cell in cells)
        table.add_row(method, *shown, f"{np.mean(gaps):.2f}", f"{max(gaps):.1f}", f"{spent[method]:.1f}")
    return table


def gaps_of(method: str, keys: Sequence[Key], rates: Rates) -> list[float]:
    """Return how far a method is behind the best one of each cell, in points."""
    return [max(found[key] for found in rates.values()) - rates[method][key] for key in keys]


def bounds_of(rates: Rates, seconds: float) -> Iterator[tuple[str, float, float]]:
    """Yield what is bounded, its value and its bound."""
    yield "most CPU of a fold, s", seconds, SECONDS
    by_trial = [key for key in rates[OURS] if key[1] == "trial"]
    if by_trial:
        gaps = gaps_of(OURS, by_trial, rates)
        yield "mean gap by trial, points", float(np.mean(gaps)), MEAN_GAP
        yield "worst gap by trial, points", max(gaps), WORST_GAP
    for cell in dict.fromkeys(cell for cell, by, _ in rates[OURS] if by == "subject"):
        own, other = (
            np.mean([rate for key, rate in rates[method].items() if key[:2] == (cell, "subject")])
            for method in (OURS, ELIMINATION)
        )
        yield f"{cell}, new people: behind elimination, points", float(other - own), 0.0


def main() -> None:
    """Print the tables, and whether the search keeps its bounds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="+", default=list(CELLS), help="of " + "; ".join(CELLS))
    parser.add_argument("--by", nargs="+", default=["trial", "subject"], choices=("trial", "subject"))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real recordings")
    parser.add_argument("--home", type=Path, default=Path("home.grasps"), help="examples/home_glove.csv, imported")
    asked, console = parser.parse_args(), Console(width=170)
    warnings.filterwarnings("ignore")
    spent = dict.fromkeys(METHODS_COMPARED, 0.0)
    rates: Rates = {method: {} for method in METHODS_COMPARED}
    with threadpool_limits(1):
        for cell in track(asked.sets, "sets", console=Console(stderr=True)):
            for method, found in measured(cell, asked.by, asked, spent).items():
                rates[method] |= found
    for by in asked.by:
        console.print(table_of(by, rates, spent))
    for what, value, bound in bounds_of(rates, spent[OURS]):
        console.print(f"{what}: {value:.2f}, at most {bound:g}: {'yes' if value <= bound else 'NO'}")


if __name__ == "__main__":
    main()
