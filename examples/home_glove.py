"""Make home_glove.csv: what a glove built at home might record. Nothing in it was measured; it is simulated.

24 pads read by a converter of 12 bits, 5 flex sensors in volts, six people, eight grasp types (names of Feix's
taxonomy), two objects each, three trials, eight frames a trial. People hold things in their own way, trials differ, and
the frames of one trial are nearly alike: so folds that part the frames of a trial flatter. Some cells are missing.

python home_glove.py home_glove.csv
"""

import csv
import sys
from random import Random

PEOPLE = ("Ana", "Ben", "Chloe", "Dmitri", "Elif", "Femi")
TRIALS, FRAMES = 3, 8
# Of each finger from the thumb on, tip first; then the palm.
PADS = (
    *(f"fsr_thumb_{place}" for place in ("tip", "mid", "base", "side")),
    *(f"fsr_index_{place}" for place in ("tip", "mid", "base", "side")),
    *(f"fsr_{finger}_{place}" for finger in ("middle", "ring", "little") for place in ("tip", "mid", "base")),
    *(f"fsr_palm_{number}" for number in range(1, 8)),
)
FLEX = ("flex_thumb", "flex_index", "flex_middle", "flex_ring", "flex_little")
# Of each grasp type: how far the five fingers are bent, 0 to 1, which pads press, and two objects.
TYPES = {
    "Medium Wrap": ((0.55, 0.65, 0.68, 0.70, 0.70), "tip mid base palm_1 palm_2 palm_3", ("bottle", "broom")),
    "Power Sphere": ((0.45, 0.50, 0.52, 0.54, 0.55), "tip mid base palm_4 palm_5", ("ball", "orange")),
    "Fixed Hook": ((0.20, 0.72, 0.74, 0.74, 0.72), "index_mid middle_mid ring_mid little_mid base", ("bag", "bucket")),
    "Index Finger Extension": (
        (0.50, 0.15, 0.68, 0.70, 0.70),
        "index_tip middle ring little palm_1",
        ("knife", "remote"),
    ),
    "Palmar Pinch": ((0.38, 0.42, 0.25, 0.22, 0.20), "thumb_tip index_tip", ("coin", "bead")),
    "Tripod": ((0.42, 0.46, 0.48, 0.28, 0.25), "thumb_tip index_tip middle_tip index_side", ("pen", "dart")),
    "Precision Disk": ((0.35, 0.38, 0.38, 0.38, 0.36), "tip", ("lid", "dial")),
    "Lateral": ((0.40, 0.66, 0.62, 0.60, 0.58), "thumb_tip index_side thumb_side", ("key", "card")),
}
# How much differs: between people, in a person's way with a grasp type, between objects and trials, and from frame to
# frame; first of the fingers' bend, then of the pads' pressure.
PERSON, HABIT, OBJECT, TRIAL, FRAME = (0.06, 0.20), (0.08, 0.45), (0.05, 0.25), (0.13, 0.65), (0.012, 0.10)
MISSING = 0.001  # the share of cells


class Glove:
    """Draws what the glove reads. Sums and products only, so that every machine makes the same numbers."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)

    def normal(self, sd: tuple[float, float]) -> list[float]:
        """Return a deviation of each finger and each pad, near enough to normal: a sum of twelve even ones."""
        scales = [sd[0]] * len(FLEX) + [sd[1]] * len(PADS)
        return [scale * (sum(self.random.random() for _ in range(12)) - 6.0) for scale in scales]

    def cells(self, state: list[float]) -> list[str]:
        """Return the readings of a hand: pads in counts, then flex sensors in volts; some cells are empty."""
        bends, presses = state[: len(FLEX)], state[len(FLEX) :]
        counts = [str(min(max(round(2600 * press), 0) + self.random.randrange(12, 40), 4095)) for press in presses]
        volts = [f"{3.3 - 2.4 * min(max(bend, 0.0), 1.0):.2f}" for bend in bends]
        return ["" if self.random.random() < MISSING else cell for cell in (*counts, *volts)]


def planned(grasp: str) -> list[float]:
    """Return how a grasp type bends the fingers and presses the pads."""
    bends, pressing, _ = TYPES[grasp]
    words = pressing.split()
    return [*bends, *(0.7 if any(word in pad for word in words) else -0.6 for pad in PADS)]


def rows(seed: int = 1) -> list[list[str]]:
    """Return the table: a header, then one row a frame."""
    glove = Glove(seed)
    table = [["person", "object", "grasp", "trial", "frame", *PADS, *FLEX]]
    ways = {(grasp, thing): glove.normal(OBJECT) for grasp in TYPES for thing in TYPES[grasp][2]}
    for person in PEOPLE:
        own = glove.normal(PERSON)
        for grasp in TYPES:
            habit = glove.normal(HABIT)
            for thing in TYPES[grasp][2]:
                for trial in range(TRIALS):
                    parts = (planned(grasp), own, habit, ways[grasp, thing], glove.normal(TRIAL))
                    held = [sum(each) for each in zip(*parts, strict=True)]
                    for frame in range(FRAMES):
                        state = [sum(each) for each in zip(held, glove.normal(FRAME), strict=True)]
                        table.append([person, thing, grasp, str(trial + 1), str(frame + 1), *glove.cells(state)])
    return table


if __name__ == "__main__":
    with open(sys.argv[1], "w", newline="", encoding="utf-8") as file:  # noqa: PTH123
        csv.writer(file, lineterminator="\n").writerows(rows())
