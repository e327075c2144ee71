"""LogitBoost compared with Weka 3.6 and LightGBM, in the same run, on one thread: 100 rounds of decision
stumps; and a fit of the additive logit on the same rows.

    python benchmarks/boosting.py [--quick]

Times are processor times, so that other work on the machine matters little, and each is the minimum of several
trainings, including reading and binning. Weka's is its process time minus that of a process that trains a single round.
Peers that are not installed are named and left out: apt-get install weka default-jre-headless, pip install lightgbm.
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded

import argparse
import resource
import subprocess
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from synthetic import grasp_like
from weka import installed, logitboost, write_arff

from thenar.compiler.trainers.logit import fit_logit
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.trainers.newton import MINIMA

CLASSES, ROUNDS = 14, 100
# Weka takes minutes with more rows.
MOST_WEKA_ROWS = 4200


def weka(bits: NDArray[np.bool_], joints: NDArray[Any], labels: NDArray[np.intp], nominal: bool) -> float:
    """Return the seconds of 100 rounds, the switches read as {0,1} or as numbers."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "train.arff"
        write_arff(path, bits, joints, labels, CLASSES, "{0,1}" if nominal else "numeric")
        return _weka_process(path, ROUNDS) - _weka_process(path, 1)


def _weka_process(path: Path, rounds: int) -> float:
    command = logitboost(rounds, "-t", str(path), "-no-cv", "-o")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if "Time taken to build model" not in done.stdout:
        raise SystemExit(f"Weka failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def lightgbm_by(rows: bool) -> Callable[[NDArray[Any], NDArray[np.intp]], object]:
    """Return a training of LightGBM, its histograms made by rows or by columns."""
    import lightgbm  # pyright: ignore[reportMissingImports]

    options = {"objective": "multiclass", "num_class": CLASSES, "num_leaves": 2, "max_depth": 1, "num_threads": 1}
    options |= {"min_data_in_leaf": 1, "min_data_in_bin": 1, "feature_pre_filter": False, "verbosity": -1}
    options |= {"learning_rate": 0.5, "force_row_wise": rows, "force_col_wise": not rows}
    return lambda X, y: lightgbm.train(options, lightgbm.Dataset(X, y, params=options), ROUNDS)


def least(train: Callable[[], object], repeats: int) -> float:
    """Return the processor seconds of the fastest of several trainings."""
    times = []
    for _ in range(repeats):
        MINIMA.clear()
        start = time.process_time()
        train()
        times.append(time.process_time() - start)
    return min(times)


def measured(rows: int, repeats: int) -> list[str]:
    """Return a line of the table."""
    bits, codes, labels = grasp_like(rows, seed=1)
    X = np.hstack([bits, codes])
    ours = least(lambda: boost(X, labels, CLASSES, rounds=ROUNDS), repeats)
    ridge = least(lambda: fit_logit(X, labels, CLASSES), repeats)
    doubles = X.astype(np.float64)
    peers: list[float | None] = [None] * 3
    if rows <= MOST_WEKA_ROWS and installed():
        peers[:2] = (weka(bits, codes, labels, nominal) for nominal in (False, True))
    if find_spec("lightgbm"):
        peers[2] = min(
            least(lambda train=train: train(doubles, labels), repeats)  # type: ignore[misc]
            for train in map(lightgbm_by, (True, False))
        )
    cells = ["-" if peer is None else f"{peer:.2f} ({peer / ours:.1f})" for peer in peers]
    return [str(rows), f"{ours:.3f}", f"{ridge:.2f} ({ridge / ours:.1f})", *cells]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1400 rows only")
    quick = parser.parse_args().quick
    inputs = "160 switches and 16 joints in half degrees"
    table = Table(title=f"{ROUNDS} rounds x {CLASSES} classes of decision stumps, {inputs}, seconds")
    for heading in ("rows", "thenar", "logit", "Weka, numeric", "Weka, nominal", "LightGBM"):
        table.add_column(heading, justify="right")
    for rows in (1400,) if quick else (1400, 4200, 50_000):
        table.add_row(*measured(rows, 5 if rows < 50_000 else 2))
    console = Console(width=120)
    console.print(table)
    console.print("In brackets: how many times the time of thenar's LogitBoost that is.")
    here = {"Weka": installed(), "LightGBM": find_spec("lightgbm")}
    if missing := [name for name, found in here.items() if not found]:
        console.print(f"Not installed, and left out: {', '.join(missing)}")


if __name__ == "__main__":
    main()
