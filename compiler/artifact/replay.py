"""A set of grasps replayed by a build: every row is predicted alone, as a live frame; and which trials of the set the
build was trained on.
"""

import hashlib
from collections.abc import Iterator, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.build import Build
from thenar.runtime.manifest import Manifest
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


def trials_recognised(grasp_set: GraspSet, found: Sequence[str]) -> NDArray[np.bool_]:
    """Return which trials (T,) the majority of their frames predicts correctly, by each row's prediction."""
    _, first, trial = np.unique(grasp_set.trial_ids, return_index=True, return_inverse=True)
    names, predicted = np.unique(found, return_inverse=True)
    return np.asarray(names[decided(predicted[np.newaxis], trial)[0]] == grasp_set.grasps[first])


_DIGITS = 8
# More would make build.json too large to load.
_MOST_DIGESTS = 1 << 20


def _digests(grasp_set: GraspSet) -> list[str]:
    """Return a digest of each trial: of its grasp type, the names of all columns, and its different frames.

    Names of subjects and objects and numbers of trials do not count: `merge` and a new import may change them.
    """
    names = (*grasp_set.switch_names, *grasp_set.joint_names, *grasp_set.taxel_names)
    order = sorted(range(len(names)), key=names.__getitem__)
    head = msgspec.json.encode([names[column] for column in order])
    values = np.hstack([grasp_set.switches, grasp_set.codes, grasp_set.taxels])[:, order].astype("<u2")
    trials = grasp_set.trial_ids
    rows = np.argsort(trials, kind="stable")
    frames = np.split(rows, np.flatnonzero(np.diff(trials[rows])) + 1) if len(rows) else []
    found = []
    for own in frames:
        parts = (head, str(grasp_set.grasps[own[0]]).encode(), *sorted({frame.tobytes() for frame in values[own]}))
        found.append(hashlib.sha256(b"".join(parts)).hexdigest()[:_DIGITS])
    return found


def stored_digests(grasp_set: GraspSet) -> str:
    """Return the digests of a training set for `Origin.trials`."""
    return "".join(sorted(set(_digests(grasp_set)))[:_MOST_DIGESTS])


def trained_on(manifest: Manifest, grasp_set: GraspSet) -> NDArray[np.bool_]:
    """Return which trials (T,) of a set the build was trained on: those with the same frames as a training trial."""
    source, found = manifest.source, _digests(grasp_set)
    if grasp_set.fingerprint() == source.fingerprint:
        return np.ones(len(found), bool)
    stored = {source.trials[at : at + _DIGITS] for at in range(0, len(source.trials), _DIGITS)}
    return np.array([digest in stored for digest in found], bool)
