"""Movements whose switches and joint say at once what is held, if anything."""

import numpy as np

from thenar.compiler.recordings.graspset import GraspSet, Joint

from ...sets import grasp_set_of

TYPES = ("pinch", "hook", "fist")
BEFORE, HELD, AFTER = 15, 30, 10


def make_movements(subjects: str = "AB", repetitions: int = 3, seed: int = 1, noise: float = 0.02) -> GraspSet:
    """Return whole movements of each type by each subject, in a random order: open, held, open again."""
    random = np.random.default_rng(seed)
    parts = []
    for subject in subjects:
        for trial, label in enumerate(random.permutation(np.repeat(np.arange(len(TYPES)), repetitions)).tolist()):
            held = int(HELD + random.integers(-5, 6))
            parts.append((subject, trial, np.repeat([len(TYPES), label, len(TYPES)], [BEFORE, held, AFTER])))
    labels = np.concatenate([states for *_, states in parts])
    sizes = [len(states) for *_, states in parts]
    switches = (labels[:, None] == np.arange(len(TYPES))) ^ (random.random((len(labels), len(TYPES))) < noise)
    codes = np.clip(np.where(labels < len(TYPES), 60 * labels + 60, 10) + random.integers(-8, 9, len(labels)), 0, 255)
    owners = np.repeat([subject for subject, *_ in parts], sizes)
    return grasp_set_of(
        TYPES,
        labels,
        switches=switches,
        switch_names=("tip", "palm", "side"),
        codes=codes[:, None],
        joints=(Joint("bend", "deg", 0, 0.0, 255, 90.0),),
        subjects=owners,
        trials=np.repeat([trial for _, trial, _ in parts], sizes),
        times_us=np.concatenate([10_000 * np.arange(np.count_nonzero(owners == each)) for each in subjects]),
    )
