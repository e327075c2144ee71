"""Weka's LogitBoost on decision stumps, as a separate process, and the files that it reads."""

import shutil
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

JAR = Path("/usr/share/java/weka.jar")


def installed() -> bool:
    """Return whether Weka and Java are installed."""
    return JAR.exists() and shutil.which("java") is not None


def logitboost(rounds: int, *options: str) -> list[str]:
    """Return the command that trains this number of rounds on one thread."""
    command = ["java", "-XX:+UseSerialGC", "-XX:ActiveProcessorCount=1", "-Xmx4g", "-cp", str(JAR)]
    command += ["weka.classifiers.meta.LogitBoost", *options, "-I", str(rounds)]
    return [*command, "-W", "weka.classifiers.trees.DecisionStump"]


def write_arff(
    path: Path, bits: NDArray[Any], joints: NDArray[Any], labels: NDArray[Any], classes: int, switch: str = "numeric"
) -> None:
    """Write rows as Weka reads them; class k is called gk."""
    head = ["@relation grasps"]
    head += [f"@attribute s{s} {switch}" for s in range(bits.shape[1])]
    head += [f"@attribute j{j} numeric" for j in range(joints.shape[1])]
    head += ["@attribute grasp {" + ",".join(f"g{k}" for k in range(classes)) + "}", "@data"]
    rows = zip(bits.astype(int).tolist(), joints.tolist(), labels.tolist(), strict=True)
    lines = [",".join([*map(str, closed), *map(repr, values), f"g{label}"]) for closed, values, label in rows]
    path.write_text("\n".join(head + lines) + "\n")
