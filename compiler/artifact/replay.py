"""A set of grasps replayed by a build: every row is predicted alone, as a live frame."""

from collections.abc import Iterator, Sequence

import numpy as np

from thenar.runtime.build import Build
from thenar.runtime.published import LiveGrasp

from ..recordings.graspset import GraspSet
from ..samples import decided
from .verify_firmware import select_inputs


def replayed(build: Build, grasp_set: GraspSet, period_us: int) -> Iterator[LiveGrasp]:
    """Yield the prediction for each row. Both clocks begin with the set.

    Raises CompileError if the set lacks inputs of the build.
    """
    bits, codes = select_inputs(grasp_set, build.manifest)
    for row, (switches, joints) in enumerate(zip(bits, codes, strict=True)):
        found = build.recognise(switches, joints)
        yield LiveGrasp(
            time_us=row * period_us,
            unix_us=row * period_us,
            number=row,
            grasp=found.grasp,
            candidate=found.grasp,
            probability=found.probability,
            margin=found.margin,
            health="degraded" if found.degraded else "ok",
            switch_age_us=None,
            glove_age_us=None,
            latency_us=0,
        )


def trials_recognised(grasp_set: GraspSet, found: Sequence[str]) -> int:
    """Return the number of trials that the majority of their frames predicts correctly, by each row's prediction."""
    _, first, trial = np.unique(grasp_set.trial_ids, return_index=True, return_inverse=True)
    names, predicted = np.unique(found, return_inverse=True)
    return int(np.count_nonzero(names[decided(predicted[np.newaxis], trial)[0]] == grasp_set.grasps[first]))
