"""thenar's ID3 compared with scikit-learn's entropy tree: seconds and memory as the rows grow from 1e3 to 1e6.

Synthetic grasps: 14 prototypes of 160 bits, each bit flipped with probability 0.1; S = 200 prunes both trees, and
scikit-learn's may grow as deep as thenar's. Every measurement runs in a separate process, limited to one thread. Memory
is the growth of the process's peak resident size above interpreter and imports, in MiB, including the input matrix (one
byte per bit for thenar, float32 for scikit-learn).

    python benchmarks/id3.py [--quick]
"""

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

N_BITS, N_CLASSES, N_BLOCK, MIN_SAMPLES, FLIP = 160, 14, 20_000, 200, 0.1
ROWS = (1_000, 10_000, 100_000, 1_000_000)
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
MIB = 2**20


class Measured(NamedTuple):
    """Seconds to grow the tree, peak memory growth in MiB, depth, leaves and training accuracy."""

    seconds: float
    mib: float
    depth: int
    leaves: int
    rate: float


def blocks(n: int) -> Any:
    """Yield (start, bits, labels) of the synthetic grasps, block by block, so that making them takes no memory."""
    rng = np.random.default_rng(1)
    prototypes = rng.random((N_CLASSES, N_BITS)) < 0.3
    for start in range(0, n, N_BLOCK):
        labels = rng.integers(N_CLASSES, size=min(N_BLOCK, n - start))
        yield start, prototypes[labels] ^ (rng.random((len(labels), N_BITS), dtype=np.float32) < FLIP), labels


def filled(n: int, dtype: str) -> tuple[Any, Any]:
    X, y = np.empty((n, N_BITS), dtype=dtype), np.empty(n, dtype=np.int64)
    for start, bits, labels in blocks(n):
        X[start : start + len(bits)] = bits
        y[start : start + len(bits)] = labels
    return X, y


def peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def trainer(what: str, depth: int) -> Callable[[Any, Any], Any]:
    """Return a training of thenar's tree, or of scikit-learn's with at most this depth."""
    if what == "thenar":
        from thenar.compiler.placement.tree import grow_id3

        return partial(grow_id3, min_samples=MIN_SAMPLES)
    from sklearn.tree import DecisionTreeClassifier

    fit: Callable[[Any, Any], Any] = DecisionTreeClassifier(
        criterion="entropy", max_depth=depth, min_samples_split=MIN_SAMPLES, random_state=0
    ).fit
    return fit


def measure(what: str, n: int, depth: int) -> Measured:
    train, before = trainer(what, depth), peak_mib()
    X, y = filled(n, "bool" if what == "thenar" else "float32")
    start = time.perf_counter()
    tree = train(X, y)
    seconds, mib = time.perf_counter() - start, peak_mib() - before
    depth, leaves = (tree.depth, tree.n_leaves) if what == "thenar" else (tree.get_depth(), tree.get_n_leaves())
    right = sum(int((tree.predict(bits) == labels).sum()) for _, bits, labels in blocks(n))
    return Measured(seconds, mib, int(depth), int(leaves), right / n)


def in_own_process(*arguments: str) -> Measured:
    """Run this file on one measurement, one thread; the best time of up to three that take under five seconds."""
    runs: list[Measured] = []
    while len(runs) < 3 and (not runs or runs[-1].seconds < 5):
        command = [sys.executable, __file__, "--one", *arguments]
        printed = subprocess.run(command, env=os.environ | ONE_THREAD, check=True, capture_output=True).stdout
        runs.append(Measured(*json.loads(printed)))
    return min(runs)


def line(n: int, name: str, found: Measured, times: str) -> str:
    return (
        f"{n:9,}  {name:14}{found.seconds:9.3f} s {found.mib:8.0f} MiB"
        f"{found.depth:7d}{found.leaves:8d}{found.rate:8.4f}  {times}"
    )


def compare(rows: tuple[int, ...]) -> None:
    """Measure and print line by line."""
    print(f"{platform.machine()}, one thread; {N_BITS} bits, {N_CLASSES} classes, S = {MIN_SAMPLES}, noise {FLIP}")
    print("     rows  what                  time       peak  depth  leaves    rate")
    for n in rows:
        ours = in_own_process("thenar", str(n), "0")
        theirs = in_own_process("sklearn", str(n), str(ours.depth))
        allowed = 2 * n * N_BITS / 8 / MIB + 256
        times = f"{theirs.seconds / ours.seconds:.0f} times as fast; {allowed:.0f} MiB are allowed"
        print(line(n, "thenar", ours, times), line(n, "scikit-learn", theirs, ""), sep="\n", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="up to 100,000 rows only")
    parser.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        what, n, depth = options.one
        print(json.dumps(measure(what, int(n), int(depth))))
        return
    compare(ROWS[:-1] if options.quick else ROWS)


if __name__ == "__main__":
    main()
