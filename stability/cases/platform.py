"""Other numbers of threads, processors, Pythons and numpys.

Every setting is a separate process, since libraries read it once on loading. They do change numbers: each finding gives
the number of its settings in which numpy's or Python's exp or matrix products gave other bits than here.
"""

import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec

from ..checks.built_bytes import Built
from ..finding import Case, Finding
from ..pythons import made

CASE = Case(
    title="The platform",
    danger="the same recordings give another build with other threads, processor instructions or Python",
)

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


class Setting(NamedTuple):
    """A process to run: its environment and its Python."""

    name: str
    environment: tuple[tuple[str, str], ...] = ()
    python: Path = Path(sys.executable)


class Ran(NamedTuple):
    """The result of a process: the files it made, or how it failed."""

    name: str
    built: Built | None
    ending: str = ""


AS_IT_IS = Setting("as it is")


def findings(full: bool) -> Iterator[Finding]:
    """Compare the files of every setting with those of this Python without settings."""
    here = run(AS_IT_IS, full)
    if here.built is None:
        yield _failed(here)
        return
    for check, settings in _settings(here.built, full):
        yield held(check, here.built, [run(setting, full) for setting in settings])
    for python in made() if full else ():
        yield _in_python(here.built, python)


def _settings(here: Built, full: bool) -> Iterator[tuple[str, list[Setting]]]:
    """Yield (check, its settings)."""
    if not full:
        yield "threads, kernels, SIMD, libm, hash order", [plainest(here), _threads(2)]
        return
    yield "BLAS threads 1 and 2", [_threads(1), _threads(2)]
    yield "BLAS kernels", [_set("OPENBLAS_CORETYPE", kernel) for kernel in _kernels(here)]
    # Instruction sets are disabled from the newest on, until none is left.
    limits = (" ".join(here.simd[kept:]) for kept in range(len(here.simd)))
    yield "numpy's SIMD limited", [_set("NPY_DISABLE_CPU_FEATURES", limit) for limit in limits]
    yield "libm without FMA and AVX2", [_set("GLIBC_TUNABLES", _PLAIN_LIBM)]
    yield "hash order", [_set("PYTHONHASHSEED", seed) for seed in ("0", "1", "4294967295")]
    yield "all of these at once", [plainest(here)]


def _in_python(here: Built, python: Path) -> Finding:
    """Compare another Python with this one: as it is, and with its libraries at their plainest."""
    there = run(AS_IT_IS._replace(python=python), full=True)
    if there.built is None:
        return _failed(there)
    limited = plainest(there.built)._replace(python=python)
    check = f"Python {there.built.python} with numpy {there.built.numpy}"
    return held(check, here, [there, run(limited, full=True)])


def _failed(ran: Ran) -> Finding:
    return Finding("a build as it is", "a process that succeeds", 1, 0, "processes", 1, ran.ending)


def held(check: str, here: Built, others: list[Ran]) -> Finding:
    """Count the files that differ from this process's. The bound is 0: bytes of files are not rounded."""
    wrong = []
    for ran in others:
        there = dict(ran.built.files) if ran.built is not None else {}
        wrong.append((ran, [name for name, digest in here.files if there.get(name) != digest]))
    moved = sum(ran.built is not None and ran.built.plain != here.plain for ran in others)
    return Finding(
        check=check,
        reference=f"bytes of a plain run (numpy's exp or products differ in {moved} of {len(others)})",
        error=sum(len(files) for _, files in wrong),
        bound=0,
        unit="files",
        tried=len(others) * len(here.files),
        worst="; ".join(f"{ran.name}: {ran.ending or ', '.join(files)}" for ran, files in wrong if files),
    )


def _threads(count: int) -> Setting:
    return _set("OPENBLAS_NUM_THREADS", str(count))


def _set(name: str, value: str) -> Setting:
    return Setting(f"{name}={value}", ((name, value),))


def _kernels(built: Built) -> tuple[str, ...]:
    """Return the kernels that this processor certainly runs: those older than OpenBLAS's default choice."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return _ARM_KERNELS
    chosen = {kernel.partition(" ")[0] for kernel in built.kernels}
    newest = max((_X86_KERNELS.index(kernel) for kernel in chosen if kernel in _X86_KERNELS), default=0)
    return _X86_KERNELS[: newest + 1]


def plainest(built: Built) -> Setting:
    """Return the setting of the oldest kernels and the fewest instructions, one thread, another order of hashes."""
    environment = {
        "OPENBLAS_NUM_THREADS": "1",
        "OPENBLAS_CORETYPE": _kernels(built)[0],
        "NPY_DISABLE_CPU_FEATURES": " ".join(built.simd),
        "GLIBC_TUNABLES": _PLAIN_LIBM,
        "PYTHONHASHSEED": "1",
    }
    return Setting("plainest", tuple(environment.items()))


def run(setting: Setting, full: bool) -> Ran:
    """Build in a process of this setting."""
    environment = {name: value for name, value in os.environ.items() if name not in _OURS} | dict(setting.environment)
    command = [str(setting.python), "-P", "-m", "thenar.stability.checks.built_bytes", *(["--large"] if full else [])]
    ran = subprocess.run(command, env=environment, capture_output=True, check=False)
    if ran.returncode:
        words = ran.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        return Ran(setting.name, None, f"{setting.python} ended with {ran.returncode} {words}".strip())
    return Ran(setting.name, msgspec.json.decode(ran.stdout, type=Built))
