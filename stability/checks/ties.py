"""Equal best scores: which class wins."""

from collections.abc import Sequence

import numpy as np

from ..finding import Finding, Worst
from ..inputs.bare_build import bare_build
from ..inputs.hard_tables import every_frame, whole_numbers


def ties(full: bool) -> Finding:
    """Of equal scores the first must win, as it does where C keeps the best so far and takes only what is greater."""
    worst = Worst("equal best scores", "the first of them", 0, "frames")
    for seed in range(30 if full else 3):
        tables = whole_numbers(seed, 5, 4, (3, 3), 1)
        build = bare_build(tables)
        for frame in every_frame(tables):
            bits, codes = np.array(frame.bits), np.array(frame.codes, np.uint16)
            scores = build.scores(bits, codes).tolist()
            best = first_best(scores)
            if scores.count(scores[best]) < 2:
                continue
            found = build.recognise(bits, codes)
            right = build.classify(bits, codes) == found.grasp == str(best) and found.margin == 0
            worst.see(float(not right), f"draw {seed}: {frame}")
    return worst.finding()


def first_best(scores: Sequence[int]) -> int:
    """Return which score is greatest, of equal ones the first; written as C would have it."""
    best = 0
    for k in range(1, len(scores)):
        if scores[k] > scores[best]:
            best = k
    return best
