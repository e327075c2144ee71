"""The cost of the runtime: its import compared with numpy, its classification with scikit-learn and onnxruntime.

    python benchmarks/runtime.py

Classification is amortised over calls with one frame each: 33 switches + 16 joints, 14 grasp types, 100 rounds.
Times are processor times, so that other work on the machine matters little.
"""

import importlib.util
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from sklearn.ensemble import GradientBoostingClassifier
from synthetic import grasp_like

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.frontier.price import machine_name
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.taxonomy import own
from thenar.runtime import Build

IMPORTS = 15
REPEATS = 7
MICRO = 1e6


def import_seconds(statement: str) -> float:
    """Return the median processor time of an import statement in a fresh interpreter."""
    program = f"import time; start = time.process_time(); {statement}; print(time.process_time() - start)"
    command = [sys.executable, "-c", program]
    runs = [subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(IMPORTS + 1)]
    return statistics.median(map(float, runs[1:]))


def call_seconds(call: Callable[[], object], calls: int) -> float:
    """Return the best of several means over `calls` calls."""

    def once() -> float:
        start = time.process_time()
        for _ in range(calls):
            call()
        return (time.process_time() - start) / calls

    return min(once() for _ in range(REPEATS))


def grasp_set() -> GraspSet:
    """Return 1400 rows of 33 switches and 16 joints, 14 grasp types."""
    bits, codes, labels = grasp_like(1400, seed=1, switches=33)
    names = [f"grasp {number}" for number in range(14)]
    return GraspSet(
        switches=bits,
        switch_names=tuple(f"s{number}" for number in range(33)),
        codes=codes,
        joints=tuple(Joint(f"j{number}", "deg", 0, 0.0, 2, 1.0) for number in range(16)),
        grasps=np.array(names)[labels],
        taxonomy=own(names),
        subjects=np.full(len(labels), "A"),
        objects=np.full(len(labels), "thing"),
        trials=np.arange(len(labels)),
    )


def onnx_call(model: GradientBoostingClassifier, row: np.ndarray) -> Callable[[], object] | None:
    """Return a call of onnxruntime on `row` (1, d) float32, or None if it or skl2onnx is not installed."""
    if not all(importlib.util.find_spec(name) for name in ("onnxruntime", "skl2onnx")):
        return None
    import onnxruntime  # pyright: ignore[reportMissingImports]
    from skl2onnx import to_onnx  # pyright: ignore[reportMissingImports]

    session = onnxruntime.InferenceSession(to_onnx(model, row, options={"zipmap": False}).SerializeToString())
    return lambda: session.run(None, {"X": row})


def main() -> None:
    print(machine_name())
    # A glove needs numpy; `import thenar.runtime` alone would not load it yet.
    numpy_s, runtime_s = import_seconds("import numpy"), import_seconds("from thenar.runtime import Glove")
    print(f"import numpy            {numpy_s * 1e3:8.1f} ms")
    print(f"import Glove            {runtime_s * 1e3:8.1f} ms   {runtime_s / numpy_s:.2f} times numpy's (at most 1.5)")

    recorded = grasp_set()
    with tempfile.TemporaryDirectory() as folder:
        manifest = compile_build(recorded, Path(folder) / "build", rounds=100, folds=0).manifest
        build = Build.load(Path(folder) / "build")
    kept = [switch.column for switch in manifest.switches]
    bits, codes = np.ascontiguousarray(recorded.switches[0, kept]), recorded.codes[0]
    ours = call_seconds(lambda: build.classify(bits, codes), 20_000)
    whole = call_seconds(lambda: build.recognise(bits, codes), 10_000)
    print(f"\none frame, {len(kept)} switches + {len(codes)} joints, {len(build.grasps)} grasp types, 100 rounds")
    scored = call_seconds(lambda: build.scorer.biased_scores(bits, codes), 20_000)
    print(f"Build.classify          {ours * MICRO:8.2f} µs   of which scores {scored * MICRO:.2f}, the rest rejection")
    print(f"Build.recognise         {whole * MICRO:8.2f} µs   with probability and margin")

    X = np.hstack([recorded.switches[:, kept], recorded.codes]).astype(np.float32)
    weights, bias = np.random.default_rng(1).random((len(build.grasps), X.shape[1])), np.zeros(len(build.grasps))
    linear_s = call_seconds(lambda: (weights @ X[0] + bias).argmax(), 20_000)
    print(f"numpy, a linear model   {linear_s * MICRO:8.2f} µs   {linear_s / ours:.2f} times Build.classify")
    model = GradientBoostingClassifier(n_estimators=100, max_depth=1).fit(X, recorded.grasps)
    sklearn_s = call_seconds(lambda: model.predict(X[:1]), 200)
    print(f"scikit-learn predict    {sklearn_s * MICRO:8.2f} µs   {sklearn_s / ours:.0f} times Build.classify")
    onnx = onnx_call(model, X[:1])
    if onnx is None:
        print("onnxruntime             not installed (pip install onnxruntime skl2onnx)")
    else:
        onnx_s = call_seconds(onnx, 2_000)
        print(f"onnxruntime             {onnx_s * MICRO:8.2f} µs   {onnx_s / ours:.1f} times Build.classify")


if __name__ == "__main__":
    main()
