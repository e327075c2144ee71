"""Digests of files that must be equal on every platform: a simulated set, and the build compiled from it.

Run as a program in another process or another Python, it prints the digests and the versions of the libraries.
"""

import hashlib
import math
import platform
import sys
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from thenar.compiler.artifact.compile import compile_build
from thenar.drivers.extras import optional
from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, TABLES_NAME
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import simulate

with optional():
    from threadpoolctl import threadpool_info

SCENE = "quick"  # 160 switches, 16 joints, 14 grasp types, two hands


class Built(msgspec.Struct, frozen=True):
    """The results of a process.

    python, numpy  their versions             kernels  the BLAS libraries' kernels and threads: "Haswell x2"
    simd           numpy's instruction sets above its baseline that are in use
    files          (name, SHA-256) of each file made
    plain          SHA-256 of plain exp and matrix products there, which a build must not depend on
    """

    python: str
    numpy: str
    kernels: tuple[str, ...]
    simd: tuple[str, ...]
    files: tuple[tuple[str, str], ...]
    plain: str


def build() -> Built:
    """Simulate a set, compile it, and return the digests of the files. Warnings are errors."""
    with warnings.catch_warnings(), TemporaryDirectory() as folder:
        warnings.simplefilter("error")
        files = _files(Path(folder))
    simd = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return Built(
        python=platform.python_version(),
        numpy=np.__version__,
        # scikit-learn also loads OpenMP's threads, which have no kernels.
        kernels=tuple(
            f"{blas['architecture']} x{blas['num_threads']}" for blas in threadpool_info() if blas["user_api"] == "blas"
        ),
        simd=tuple(simd),
        files=files,
        plain=_digest(_plain()),
    )


def _files(folder: Path) -> tuple[tuple[str, str], ...]:
    # Small: about half a second.
    scene = msgspec.structs.replace(load_scene(SCENE), repetitions=3)
    found = simulate(scene, jobs=1).grasp_set
    recorded = folder / "set.grasps"
    found.save(recorded)
    made = compile_build(found, folder / "build", rounds=20, folds=2).folder
    files = recorded, *(made / name for name in (MANIFEST_NAME, TABLES_NAME, ENSEMBLE_NAME))
    return tuple((file.name, _digest(file.read_bytes())) for file in files)


def _plain() -> bytes:
    """Return processor-dependent results of numpy, the BLAS and libm: a matrix product, and exp by two methods."""
    numbers = (np.arange(300 * 500) % 99_991 / 33_331.0).reshape(300, 500)
    products = numbers @ numbers.T / 10_000
    return np.exp(products).tobytes() + np.array([math.exp(number) for number in numbers.flat]).tobytes()


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


if __name__ == "__main__":
    sys.stdout.buffer.write(msgspec.json.encode(build()))
