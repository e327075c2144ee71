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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
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


@dataclass(frozen=True, eq=False)
class Cut:
    """Rows to choose from and rows to test on."""

    train: Samples
    test: Samples


def cuts(samples: Samples, by: str) -> Iterator[Cut]:
    """Yield the folds by trial, or by groups of people."""
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
        yield Cut(samples.rows(train), samples.rows(test))


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


OURS, ELIMINATION = PAIR = "floating search (thenar)", "elimination"
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


def accuracy(cut: Cut, sensors: Columns) -> float:
    """Return the share of test rows that a logistic regression of these sensors recognises."""
    columns = sorted(sensors)
    X, T, y = values(cut.train)[:, columns], values(cut.test)[:, columns], cut.train.labels
    if not columns:
        return float((cut.test.labels == cut.train.most_frequent).mean())
    models = [make_pipeline(StandardScaler(), LogisticRegression(C=C, max_iter=300, tol=1e-3)) for C in CS]
    inner = trial_folds(y, cut.train.trials, 3, SEED)
    means = [
        np.mean([model.fit(X[f.train], y[f.train]).score(X[f.test], y[f.test]) for f in inner]) for model in models
    ]
    return float(models[int(np.argmax(means))].fit(X, y).score(T, cut.test.labels))


def main() -> None:
    """Print the table, and whether the search keeps its bounds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="+", default=list(CELLS), help="of " + "; ".join(CELLS))
    parser.add_argument("--by", nargs="+", default=["trial", "subject"], choices=("trial", "subject"))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real recordings")
    parser.add_argument("--home", type=Path, default=Path("home.grasps"), help="examples/home_glove.csv, imported")
    asked, console = parser.parse_args(), Console(width=170)
    warnings.filterwarnings("ignore")
    rates: dict[str, dict[str, list[float]]] = {name: {} for name in METHODS_COMPARED}
    spent = dict.fromkeys(METHODS_COMPARED, 0.0)
    with threadpool_limits(1):
        for cell in track(asked.sets, "sets", console=Console(stderr=True)):
            name, kinds, sizes = CELLS[cell]
            samples = load(str(asked.home) if name == "home" else name, asked.data).without_none()
            samples = samples.with_joints(()) if kinds == "switches" else samples
            for by in asked.by:
                if by == "subject" and len(np.unique(samples.subjects)) < LEAST_PEOPLE:
                    continue
                for cut in cuts(samples, by):
                    for method, choose in METHODS_COMPARED.items():
                        began = process_time()
                        chosen = choose(cut.train, sizes)
                        seconds = process_time() - began
                        spent[method] = max(spent[method], seconds)
                        for size in sizes:
                            rates[method].setdefault(f"{cell} {by} {size}", []).append(accuracy(cut, chosen[size]))
    means = {
        method: {key: 100 * float(np.mean(hits)) for key, hits in found.items()} for method, found in rates.items()
    }
    best = {key: max(found[key] for found in means.values()) for key in means["random"]}
    for by in asked.by:
        shown = [cell for cell in asked.sets if any(key.startswith(f"{cell} {by}") for key in best)]
        table = Table("method", *shown, "mean gap", "worst", "s", title=f"by {by}, %")
        for method, found in means.items():
            keys = [key for key in best if f" {by} " in key]
            cells = [
                " / ".join(f"{found[key]:.1f}" for key in keys if key.startswith(f"{cell} {by}")) for cell in shown
            ]
            gaps = [best[key] - found[key] for key in keys] or [0.0]
            table.add_row(method, *cells, f"{np.mean(gaps):.2f}", f"{max(gaps):.1f}", f"{spent[method]:.1f}")
        console.print(table)
    gaps = [best[key] - rate for key, rate in means[OURS].items() if " trial " in key]
    people = {
        cell: [
            float(np.mean([means[method][key] for key in best if key.startswith(f"{cell} subject")])) for method in PAIR
        ]
        for cell in asked.sets
        if any(key.startswith(f"{cell} subject") for key in best)
    }
    bounds = [("most CPU of a fold, s", spent[OURS], SECONDS)]
    if gaps:
        bounds += [("mean gap by trial, points", float(np.mean(gaps)), MEAN_GAP), ("worst", max(gaps), WORST_GAP)]
    bounds += [(f"{cell}, new people: behind elimination", other - own, 0.0) for cell, (own, other) in people.items()]
    for what, value, bound in bounds:
        console.print(f"{what}: {value:.2f}, at most {bound:g}: {'yes' if value <= bound else 'NO'}")


if __name__ == "__main__":
    main()
