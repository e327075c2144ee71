"""Coverage of the 95 % intervals of accuracies, by simulation; docs/explanation/evaluation.md sums it up.

Frames: trials of 1 to 50 frames, whose design effect is 1 (frames as different as trials), 2 or 5 (as real frames). A
trial's own accuracy is drawn from a beta distribution. New subjects: 5 to 30 people with accuracies from one. Each
figure is of draws with true accuracies from 0.5 to 0.98.

    python benchmarks/intervals.py [DRAWS]
"""

import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.evaluation.rates import clustered
from thenar.runtime.manifest import Unit

ACCURACIES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
FRAMES = ((1, 1.0), (2, 1.5), (8, 1.0), (8, 2.0), (8, 5.0), (15, 5.0), (50, 1.0), (50, 5.0))
TRIALS = (20, 50, 200, 1000)
SUBJECTS = (5, 7, 12, 20, 30)
ALIKE = (0.02, 0.05, 0.1, 0.15)


def recognised(
    random: np.random.Generator, clusters: int, size: int, alike: float, accuracy: float
) -> NDArray[np.int64]:
    """Return the number of correct units of `size` in each cluster (clusters,); `alike` is their correlation."""
    if alike == 0:
        return random.binomial(size, accuracy, clusters)
    strength = 1 / alike - 1
    return random.binomial(size, random.beta(accuracy * strength, (1 - accuracy) * strength, clusters))


def coverage(unit: Unit, clusters: int, size: int, alike: float, accuracy: float, draws: int) -> float:
    """Return the share of draws whose interval covers `accuracy`; clusters are trials, or subjects of trials."""
    random, covered = np.random.default_rng(round(1000 * accuracy)), 0
    for _ in range(draws):
        drawn = recognised(random, clusters, size, alike, accuracy)
        low, high = clustered(drawn.tolist(), [size] * clusters, unit)
        covered += low <= accuracy <= high
    return covered / draws


def of_frames(draws: int) -> Iterator[tuple[int, float, int, list[float]]]:
    """Yield frames per trial, design effect, trials, and the coverage at each accuracy."""
    for frames, effect in FRAMES:
        alike = (effect - 1) / (frames - 1) if frames > 1 else 0.0
        for trials in TRIALS:
            yield (
                frames,
                effect,
                trials,
                [coverage("frames", trials, frames, alike, each, draws) for each in ACCURACIES],
            )


def of_subjects(draws: int, trials: int = 100) -> Iterator[tuple[int, float, list[float]]]:
    """Yield subjects, the correlation within them, and the coverage at each accuracy."""
    for subjects in SUBJECTS:
        for alike in ALIKE:
            yield subjects, alike, [coverage("trials", subjects, trials, alike, each, draws) for each in ACCURACIES]


def main() -> None:
    """Print both tables: mean, minimum and maximum over the accuracies."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    print("| frames a trial | design effect | trials | coverage % | least | most |\n|---|---|---|---|---|---|")
    for frames, effect, trials, found in of_frames(draws):
        print(f"| {frames} | {effect:g} | {trials} | {_of(found)} |")
    print("\n| subjects left out | correlation | coverage % | least | most |\n|---|---|---|---|---|")
    for subjects, alike, found in of_subjects(draws):
        print(f"| {subjects} | {alike:g} | {_of(found)} |")


def _of(found: list[float]) -> str:
    return f"{100 * sum(found) / len(found):.1f} | {100 * min(found):.1f} | {100 * max(found):.1f}"


if __name__ == "__main__":
    main()
