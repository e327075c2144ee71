"""Placements within a scan time: thenar's methods under --budget-us, and peers that use costs.

    python benchmarks/budget.py SET.grasps [--budgets US ...] [--folds N]

A switch costs the time of its port on the whole glove as wired (MCP23017 at 400 kHz), shared by all switches of the
port. Placement and classifier (LogitBoost, 100 rounds) are trained on the training part of each fold, and rates are
means over the folds. Peers use a cost per switch, its share of its port, and do not know that a port is shared:

- PySensors' CCQR: pivoted QR with costs, which ignores labels; its costs are scaled to the norms of the columns.
- PySensors' SSPOC has no costs: its ranking is cut at the budget.
- scikit-learn's RFE on logistic regression, with columns scaled by their costs, so that weights are divided by them.
- scikit-learn's SequentialFeatureSelector, forward, on BernoulliNB: the score is accuracy less PRICE times mean cost.

Every ranking is cut by thenar's rule: each next switch is taken unless it exceeds the budget.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from placementlines import CONSOLE, rate
from rich.table import Table

from thenar.compiler.evaluation.folds import weka_folds
from thenar.compiler.placement.constraints import Bound, Limits
from thenar.compiler.placement.elements import elements_of
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.placement.placement import choose
from thenar.compiler.placement.ports import PortCosts, ports_of_whole_glove
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Columns, Samples

OURS = ("elimination", "elimination-cost", "id3-cost", "id3-ccp", "sspoc", "cmim")
SEED, PRICE, MOST = 1, 0.002, 16
Bits = NDArray[np.bool_]
Labels = NDArray[np.intp]
Costs = NDArray[np.float64]


def ccqr(bits: Bits, _: Labels, costs: Costs) -> Columns:
    """Return the columns in the order of QR's pivots, less their costs."""
    from pysensors.optimizers import CCQR  # pyright: ignore[reportMissingImports]
    from pysensors.reconstruction import SSPOR  # pyright: ignore[reportMissingImports]

    norms = np.linalg.norm(bits, axis=0)
    model = SSPOR(optimizer=CCQR(sensor_costs=costs * np.median(norms) / 4))
    model.fit(bits.astype(np.float64), quiet=True, seed=SEED)
    return tuple(int(column) for column in model.get_all_sensors())


def rfe(bits: Bits, labels: Labels, costs: Costs) -> Columns:
    """Return the columns in the reverse of the order in which RFE drops them."""
    from sklearn.feature_selection import RFE
    from sklearn.linear_model import LogisticRegression

    model = RFE(LogisticRegression(max_iter=2000, tol=1e-2), n_features_to_select=1, step=4)
    return tuple(np.argsort(model.fit(bits * costs, labels).ranking_, kind="stable").tolist())


def forward(bits: Bits, labels: Labels, costs: Costs) -> Columns:
    """Return MOST columns by forward selection, starting with those of the largest information."""
    from sklearn.feature_selection import SequentialFeatureSelector
    from sklearn.naive_bayes import BernoulliNB

    def score(model: Any, X: Costs, y: Labels) -> float:
        return float(model.score(X, y)) - PRICE * float(X.max(axis=0).sum())

    model = SequentialFeatureSelector(BernoulliNB(), n_features_to_select=MOST, scoring=score, cv=2)
    chosen: Bits = np.asarray(model.fit(bits * costs, labels).get_support())
    order = METHODS["mutual-information"].chooser(samples_of(bits, labels))(bits.shape[1])
    return tuple(column for column in order if chosen[column])


PEERS: dict[str, Callable[[Bits, Labels, Costs], Columns]] = {
    "PySensors CCQR": ccqr,
    "RFE, scaled by cost": rfe,
    "SequentialFeatureSelector": forward,
}


def samples_of(bits: Bits, labels: Labels) -> Samples:
    """Return bits (n, s) and labels (n,) as samples."""
    return Samples(bits, np.zeros((len(bits), 0), np.uint16), labels, tuple(map(str, range(int(labels.max()) + 1))))


def peers_columns(name: str, learning: Samples, costs: Costs, bounds: Sequence[Bound]) -> list[Columns]:
    """Return the columns that a peer keeps under each budget."""
    varying = np.flatnonzero(learning.switches.any(axis=0) & ~learning.switches.all(axis=0))
    order = PEERS[name](learning.switches[:, varying], learning.labels, costs[varying])
    return [bound.obeyed(tuple(varying[list(order)].tolist()), learning.n_switches) for bound in bounds]


def our_columns(name: str, learning: Samples, ports: PortCosts, bounds: Sequence[Bound]) -> list[Columns]:
    """Return the columns that a method keeps under each budget, as many switches as fit."""
    if METHODS[name].nested:
        order = METHODS[name].chooser(learning, ports)(learning.n_switches)
        return [bound.obeyed(order, learning.n_switches) for bound in bounds]
    return [choose(learning, name, learning.n_switches, ports, bound)[0] for bound in bounds]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", type=Path)
    parser.add_argument("--budgets", type=float, nargs="+", default=[125.0, 250.0])
    parser.add_argument("--folds", type=int, default=2)
    asked = parser.parse_args()
    grasp_set = GraspSet.load(asked.set)
    samples = Samples.of(grasp_set, "switches")
    ports = ports_of_whole_glove(None, grasp_set.element_names)
    assert ports is not None
    costs = ports.shares(range(samples.n_switches))
    costs /= costs.mean()
    table = Table(
        "", *(f"{us:g} us" for us in asked.budgets), "CPU s", title=f"{asked.set.stem}: accuracy % (switches)"
    )
    for name in (*(name for name in OURS if METHODS[name].installed), *PEERS):
        found, start, spent = [], 0.0, 0.0
        for fold in weka_folds(samples.labels, asked.folds, SEED):
            learning, start = samples.rows(np.sort(fold.train)), process_time()
            bounds = [
                Limits(names=grasp_set.element_names, n_switches=samples.n_switches, budget_us=us).on(
                    elements_of(learning), ports
                )
                for us in asked.budgets
            ]
            columns = (
                peers_columns(name, learning, costs, bounds)
                if name in PEERS
                else our_columns(name, learning, ports, bounds)
            )
            spent += process_time() - start
            found.append([(rate(samples, fold, each), len(each)) for each in columns])
        means = np.mean(found, axis=0)
        table.add_row(name, *(f"{100 * right:.1f} ({size:.0f})" for right, size in means), f"{spent / asked.folds:.0f}")
    CONSOLE.print(table)


if __name__ == "__main__":
    main()
