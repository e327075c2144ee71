"""The installed Weka 3.6, run as a program beside thenar: its LogitBoost on a set, read off the model that it prints.

Weka is not part of thenar and nothing of it is: where java or its jar are missing, this part is not run and says so.
"""

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.boosting.stumps import Stumps
from thenar.drivers.errors import ThenarError

JAR = Path("/usr/share/java/weka.jar")  # where Debian's package puts it

# The JVM has two exp(): the processor's own, which is its choice, and the portable one, which this makes it take.
EXP_OF_THE_PROCESSOR: tuple[str, ...] = ()
EXP_IN_JAVA = ("-XX:+UnlockDiagnosticVMOptions", "-XX:-UseLibmIntrinsic")

_LONGEST_S = 120.0
_BRANCHES = tuple(re.compile(rf"^x(\d+) {branch} : (\S+)$", re.M) for branch in (r"<= (\S+)", r"> (\S+)", "is missing"))


class WekaError(ThenarError, RuntimeError):
    """Weka could not be run, or what it printed is not a model of what it was given."""


@dataclass(frozen=True, slots=True)
class Weka:
    """An installed Weka."""

    java: str
    jar: Path

    @staticmethod
    def installed() -> "Weka":
        """Return the one that is installed. Raises WekaError if there is none."""
        java = shutil.which("java")
        if java is None or not JAR.is_file():
            raise WekaError("java or Weka is not installed")
        return Weka(java, JAR)

    def version(self) -> str:
        """Return the version, such as "3.6.14"."""
        return self._run("weka.core.Version").partition("\n")[0].strip()

    def boost(
        self, X: NDArray[np.int64], labels: NDArray[np.intp], n_classes: int, rounds: int, options: tuple[str, ...]
    ) -> Stumps:
        """Train Weka's LogitBoost on X (n, d) whole numbers and labels (n,) under JVM `options`; return its stumps.

        They are at full precision: Java prints a double so that it reads back as itself. Raises WekaError.
        """
        with TemporaryDirectory(prefix="thenar-weka-") as folder:
            table = Path(folder) / "set.arff"
            table.write_text(_arff(X, labels, n_classes))
            arguments = ("-I", str(rounds), "-no-cv", "-v", "-t", str(table))
            printed = self._run("weka.classifiers.meta.LogitBoost", *arguments, options=options)
        return read_stumps(printed, rounds, n_classes, X.shape[1])

    def _run(self, *arguments: str, options: tuple[str, ...] = ()) -> str:
        command = [self.java, *options, "-cp", str(self.jar), *arguments]
        try:
            return subprocess.run(command, check=True, capture_output=True, text=True, timeout=_LONGEST_S).stdout
        except subprocess.CalledProcessError as reason:
            said = (reason.stderr or reason.stdout).strip().partition("\n")[0]
            raise WekaError(f"java ended with code {reason.returncode}: {said}") from reason
        except subprocess.TimeoutExpired as reason:
            raise WekaError(f"Weka was not done after {_LONGEST_S:g} s") from reason


def read_stumps(printed: str, rounds: int, n_classes: int, n_inputs: int) -> Stumps:
    """Return the stumps of a model that Weka printed, columns named x0, x1, ... Raises WekaError if it is another."""
    left, right, missing = (pattern.findall(printed) for pattern in _BRANCHES)
    if not len(left) == len(right) == len(missing) == rounds * n_classes:
        raise WekaError(f"Weka printed {len(left)} stumps, not {rounds} rounds of {n_classes}")
    shape = rounds, n_classes
    columns = np.array([int(column) for column, _, _ in left], dtype=np.int32).reshape(shape)
    if columns.max() >= n_inputs:
        raise WekaError(f"Weka split column {columns.max()} of {n_inputs}")
    values = np.array([[float(line[-1]) for line in lines] for lines in (left, right, missing)])
    thresholds = np.array([float(threshold) for _, threshold, _ in left]).reshape(shape)
    return Stumps(n_inputs, columns, thresholds, values.T.reshape(*shape, 3), shrinkage=1.0)


def _arff(X: NDArray[np.int64], labels: NDArray[np.intp], n_classes: int) -> str:
    classes = ",".join(f"c{number}" for number in range(n_classes))
    lines = ["@relation separable", *(f"@attribute x{column} numeric" for column in range(X.shape[1]))]
    lines += [f"@attribute class {{{classes}}}", "@data"]
    lines += [",".join([*map(str, row), f"c{label}"]) for row, label in zip(X.tolist(), labels.tolist(), strict=True)]
    return "\n".join([*lines, ""])
