"""Other numbers of threads, processors, Pythons and numpys.

Files must be equal on every platform: a simulated set, and the build compiled from it. Every setting is a separate
process of this module as a program, since libraries read it once on loading. They do change numbers: each finding gives
the number of its settings in which numpy's or Python's exp or matrix products gave other bits than here.
"""

import hashlib
import math
import os
import platform
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec
import numpy as np

from thenar.compiler.artifact.compile import compile_build
from thenar.drivers.extras import optional
from thenar.runtime.build import ENSEMBLE_NAME, MANIFEST_NAME, TABLES_NAME
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import simulate

from ..finding import Finding
from ..pythons import made

with optional():
    from threadpoolctl import threadpool_info


# Variables that may be set outside, and would make the settings less different than intended.
_OURS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "OPENBLAS_CORETYPE",
    "NPY_DISABLE_CPU_FEATURES",
    "PYTHONHASHSEED",
    "GLIBC_TUNABLES",
)

# OpenBLAS's kernels by the processors they need, each of which also runs those before it; numpy needs at least Nehalem.
# ARM's have one in common.
_X86_KERNELS = ("Nehalem", "Sandybridge", "Haswell", "SkylakeX")
_ARM_KERNELS = ("ARMV8",)
# glibc's exp, log, sin and pow have variants for fused multiply-add and AVX2; without them the plain variants run.
_PLAIN_LIBM = "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4"


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
        # 160 switches, 16 joints, 14 grasp types, two hands: about half a second.
        found = simulate(msgspec.structs.replace(load_scene("quick"), repetitions=3), jobs=1).grasp_set
        recorded = Path(folder) / "set.grasps"
        found.save(recorded)
        compiled = compile_build(found, Path(folder) / "build", rounds=20, folds=2).folder
        paths = recorded, *(compiled / name for name in (MANIFEST_NAME, TABLES_NAME, ENSEMBLE_NAME))
        files = tuple((path.name, hashlib.sha256(path.read_bytes()).hexdigest()) for path in paths)
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
        plain=hashlib.sha256(_plain()).hexdigest(),
    )


def _plain() -> bytes:
    """Return processor-dependent results of numpy, the BLAS and libm: a matrix product, and exp by two methods."""
    numbers = (np.arange(300 * 500) % 99_991 / 33_331.0).reshape(300, 500)
    products = numbers @ numbers.T / 10_000
    return np.exp(products).tobytes() + np.array([math.exp(number) for number in numbers.flat]).tobytes()


class PlatformSetting(NamedTuple):
    """A process to run: its environment and its Python."""

    name: str
    environment: tuple[tuple[str, str], ...] = ()
    python: Path = Path(sys.executable)


AS_IT_IS = PlatformSetting("as it is")
_FAILED = ("a build as it is", "a process that succeeds", 1, 0, "processes", 1)


def findings(full: bool) -> Iterator[Finding]:
    """Compare the files of every setting with those of this Python without settings."""
    here = run(AS_IT_IS)
    if isinstance(here, str):
        yield Finding(*_FAILED, here)
        return
    settings = [plainest(here), _set("OPENBLAS_NUM_THREADS", "2")]
    if full:
        settings += [_set("OPENBLAS_CORETYPE", kernel) for kernel in _kernels(here)]
        # Instruction sets are disabled from the newest on, until none is left.
        settings += [_set("NPY_DISABLE_CPU_FEATURES", " ".join(here.simd[kept:])) for kept in range(len(here.simd))]
        settings += [_set("GLIBC_TUNABLES", _PLAIN_LIBM)]
        settings += [_set("PYTHONHASHSEED", seed) for seed in ("0", "1", "4294967295")]
    yield _compared("threads, kernels, SIMD, libm, hash order", here, settings)
    for python in made() if full else ():
        there = run(AS_IT_IS._replace(python=python))
        if isinstance(there, str):
            yield Finding(*_FAILED, there)
        else:
            check = f"Python {there.python} with numpy {there.numpy}"
            yield _compared(check, here, [AS_IT_IS._replace(python=python), plainest(there)._replace(python=python)])


def _compared(check: str, here: Built, settings: list[PlatformSetting]) -> Finding:
    """Count the files that differ from this process's. The bound is 0: bytes of files are not rounded."""
    worst = Finding.of(check, "bytes of a plain run", 0, "files")
    moved = 0
    for setting in settings:
        there = run(setting)
        files = {} if isinstance(there, str) else dict(there.files)
        wrong = [name for name, digest in here.files if files.get(name) != digest]
        at = there if isinstance(there, str) else ", ".join(wrong)
        worst.see(len(wrong), f"{setting.name}: {at}", tried=len(here.files))
        moved += not isinstance(there, str) and there.plain != here.plain
    worst.reference += f" (numpy's exp or products differ in {moved} of {len(settings)})"
    return worst


def _set(name: str, value: str) -> PlatformSetting:
    return PlatformSetting(f"{name}={value}", ((name, value),))


def _kernels(built: Built) -> tuple[str, ...]:
    """Return the kernels that this processor certainly runs: those older than OpenBLAS's default choice."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return _ARM_KERNELS
    chosen = {kernel.partition(" ")[0] for kernel in built.kernels}
    newest = max((_X86_KERNELS.index(kernel) for kernel in chosen if kernel in _X86_KERNELS), default=0)
    return _X86_KERNELS[: newest + 1]


def plainest(built: Built) -> PlatformSetting:
    """Return the setting of the oldest kernels and the fewest instructions, one thread, another order of hashes."""
    environment = {
        "OPENBLAS_NUM_THREADS": "1",
        "OPENBLAS_CORETYPE": _kernels(built)[0],
        "NPY_DISABLE_CPU_FEATURES": " ".join(built.simd),
        "GLIBC_TUNABLES": _PLAIN_LIBM,
        "PYTHONHASHSEED": "1",
    }
    return PlatformSetting("plainest", tuple(environment.items()))


def run(setting: PlatformSetting) -> Built | str:
    """Build in a process of this setting; return the digests, or how the process failed."""
    environment = {name: value for name, value in os.environ.items() if name not in _OURS} | dict(setting.environment)
    command = [str(setting.python), "-P", "-m", __name__]
    ran = subprocess.run(command, env=environment, capture_output=True, check=False)
    if ran.returncode:
        words = ran.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        return f"{setting.python} ended with {ran.returncode} {words}".strip()
    return msgspec.json.decode(ran.stdout, type=Built)


if __name__ == "__main__":
    sys.stdout.buffer.write(msgspec.json.encode(build()))
