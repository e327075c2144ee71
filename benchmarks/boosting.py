"""LogitBoost beside Weka 3.6's, in the same run, on one thread: training time of 100 rounds of decision stumps.

    python benchmarks/boosting.py [--quick]

Needs java and Debian's weka.jar for the ratios (apt-get install weka default-jre-headless); without them it prints
ours.
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before numpy is loaded: one thread, as Weka

import argparse
import re
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from synthetic import grasp_like

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import winners

WEKA_JAR = Path("/usr/share/java/weka.jar")
CLASSES = 14
ROUNDS = 100


def write_arff(
    path: Path, bits: NDArray[np.bool_], codes: NDArray[np.uint16], labels: NDArray[np.intp], nominal: bool
) -> None:
    """Write the rows as Weka reads them, the switches as {0,1} or as numbers."""
    switch = "{0,1}" if nominal else "numeric"
    head = ["@relation grasps"]
    head += [f"@attribute s{s} {switch}" for s in range(bits.shape[1])]
    head += [f"@attribute j{j} numeric" for j in range(codes.shape[1])]
    head += ["@attribute grasp {" + ",".join(f"g{k}" for k in range(CLASSES)) + "}", "@data"]
    rows = [
        ",".join([*map(str, b), *map(str, c), f"g{k}"])
        for b, c, k in zip(bits.astype(int).tolist(), codes.tolist(), labels.tolist(), strict=True)
    ]
    path.write_text("\n".join(head + rows) + "\n")


def weka_seconds(path: Path) -> float:
    """Return what Weka says its training took."""
    command = ["java", "-XX:+UseSerialGC", "-XX:ActiveProcessorCount=1", "-Xmx4g", "-cp", str(WEKA_JAR)]
    command += ["weka.classifiers.meta.LogitBoost", "-t", str(path), "-no-cv", "-o", "-I", str(ROUNDS)]
    command += ["-W", "weka.classifiers.trees.DecisionStump"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = re.search(r"Time taken to build model: ([0-9.]+) seconds", done.stdout)
    if found is None:
        raise SystemExit(f"Weka printed no training time:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return float(found.group(1))


def our_seconds(X: NDArray[np.uint16], labels: NDArray[np.intp], repeats: int = 5) -> float:
    """Return the median training time of `repeats` trainings."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        boost(X, labels, CLASSES, rounds=ROUNDS)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1400 rows only")
    sizes = (1400,) if parser.parse_args().quick else (1400, 4200)
    weka = WEKA_JAR.exists() and shutil.which("java") is not None
    table = Table(title=f"Training {ROUNDS} rounds x {CLASSES} classes of decision stumps, one thread, seconds")
    for heading in ("rows", "columns", "switches are", "Weka 3.6", "thenar", "times faster", "wanted"):
        table.add_column(heading, justify="right")
    for rows in sizes:
        bits, codes, labels = grasp_like(rows, seed=1)
        X = np.hstack([bits.astype(np.uint16), codes])
        ours = our_seconds(X, labels)
        for nominal, wanted in ((False, 30 if rows == 1400 else 50), (True, 10)):
            theirs = None
            if weka:
                with tempfile.TemporaryDirectory() as folder:
                    path = Path(folder) / "train.arff"
                    write_arff(path, bits, codes, labels, nominal)
                    theirs = weka_seconds(path)
            table.add_row(
                str(rows),
                f"{bits.shape[1]} + {codes.shape[1]}",
                "nominal" if nominal else "numeric",
                "not installed" if theirs is None else f"{theirs:.2f}",
                f"{ours:.3f}",
                "-" if theirs is None else f"{theirs / ours:.1f}",
                f">= {wanted}",
            )
    console = Console(width=110)
    console.print(table)
    stumps, _ = boost(X, labels, CLASSES, rounds=ROUNDS)
    console.print(f"Rows of the last training set recognised: {(winners(stumps.scores(X)) == labels).mean():.4f}")


if __name__ == "__main__":
    main()
