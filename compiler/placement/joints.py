"""Select the joints to keep, given the kept switches: every sensor takes time to digitise and to send.

Backward elimination on score tables of the switches and the joints' levels, fitted jointly (`logistic`): repeatedly
drop the joint whose removal raises the loss least. CANDIDATES joints have the smallest immediate increase; each is
refitted for TRIAL_STEPS more steps, and the one with the lowest loss is dropped, of equal ones the lowest number.
"""

import numpy as np

from ..samples import Columns, Samples
from .constraints import Limits
from .logistic import Logistic
from .methods.elimination import FIRST_STEPS, STEPS, TRIAL_STEPS, sampled, thermometer

MOST_ROWS, CANDIDATES = 2048, 4


def joint_order(samples: Samples) -> Columns:
    """Return the varying joints, most important first (the last one dropped), given all the switches of these rows."""
    rows = sampled(samples, MOST_ROWS)
    levels = [thermometer(rows.codes[:, [joint]]) for joint in range(rows.codes.shape[1])]
    left = [joint for joint, bits in enumerate(levels) if len(bits)]
    if len(left) < 2:
        return tuple(left)
    fit = Logistic(np.concatenate([*(levels[joint] for joint in left), rows.switches.T]), rows.labels, rows.n_classes)
    fit.improve(FIRST_STEPS)
    gone: list[int] = []
    while len(left) > 1:
        ends = np.cumsum([0, *(len(levels[joint]) for joint in left)]).tolist()
        without = [fit.without(list(range(*ends[place : place + 2]))) for place in range(len(left))]
        likeliest = sorted(range(len(left)), key=lambda place: without[place].loss)[:CANDIDATES]
        for place in likeliest:
            without[place].improve(TRIAL_STEPS)
        worst = min(likeliest, key=lambda place: (without[place].loss, left[place]))
        fit = without[worst]
        fit.improve(STEPS - TRIAL_STEPS)
        gone.append(left.pop(worst))
    return (*left, *gone[::-1])


def kept_joints(samples: Samples, most: int | None, limits: Limits | None = None) -> Columns:
    """Return at most `most` joints to keep, ascending, given the switches of these rows; None: all that `limits` allow.

    Raises PlacementError if the limits require more joints.
    """
    every: Columns = tuple(range(samples.codes.shape[1]))
    if not every:
        return ()
    keep, never, most = ((), (), most or len(every)) if limits is None else limits.on_joints(most)
    every = tuple(joint for joint in every if joint not in never)
    if most >= len(every) or not most:
        return every[:most]
    order = dict.fromkeys((*keep, *joint_order(samples)))
    return tuple(sorted([joint for joint in order if joint not in never][:most]))
