"""Small sets of grasps, made of what matters in them, and training that chooses nothing."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import own
from thenar.compiler.trainers.base import TRAINERS
from thenar.runtime.published import NONE


def grasp_set_of(types: Sequence[str], labels: ArrayLike, **columns: Any) -> GraspSet:
    """Return a set of rows that hold the types of these numbers, after the last of which "none" follows.

    What is missing in `columns`, fields of GraspSet, is plain: no inputs; inputs with numbers for names; one subject
    and object; each row a trial.
    """
    rows = np.asarray(labels, np.intp)
    switches = np.asarray(columns.pop("switches", np.zeros((len(rows), 0))), bool)
    codes = np.asarray(columns.pop("codes", np.zeros((len(rows), 0)))).astype(np.uint16)
    plain = {
        "switch_names": tuple(f"s{number}" for number in range(switches.shape[1])),
        "joints": tuple(Joint(f"j{number}", "deg", 0, 0.0, 255, 127.5) for number in range(codes.shape[1])),
        "grasps": np.array([*types, NONE])[rows],
        "subjects": np.full(len(rows), "A"),
        "objects": np.full(len(rows), "thing"),
        "trials": np.arange(len(rows)),
    }
    return GraspSet(switches=switches, codes=codes, taxonomy=own(types), **(plain | columns))


@contextmanager
def single_settings() -> Iterator[None]:
    """Let each trainer have one set of settings, so that none are compared."""
    with pytest.MonkeyPatch.context() as patched:
        few = {"max_bins": 4}
        for name, more in {"logit": {}, "pairs": {"pairs": 1, "pair_bins": 2}}.items():
            patched.setattr(TRAINERS[name], "tried", (few | more,))
        yield
