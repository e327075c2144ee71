"""contact.quasistatic: hand and object at rest, in numpy. The default contact model of a scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from typing import Annotated

import msgspec
import numpy as np

from ..body.hand import CAPSULES, Hand
from ..body.layout import SwitchPlaces, murakami160
from ..body.shapes import rotation_vector
from ..contact.balance import USUAL, Skin, SolverSettings
from ..contact.model import Contact, ContactModel, Load, split
from ..contact.settle import Rest, close
from ..pipeline.effect import CONTACT_READS, CONTACT_WRITES, Effect, SceneSetting

_Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]
# Repetitions solved at a time: enough to amortise numpy's calls, few enough for the processor's cache.
_TOGETHER = 512


# Defaults are ours, of the order of published finger pulp.
USUAL_SKIN = Skin(press_n_per_mm=3.0, soft_mm=0.5, drag_n_per_mm=1.5, friction=0.8)
REACH_MM = 1.0
MOST_STEPS = 40


@dataclass(frozen=True, slots=True)
class Quasistatic:
    """The contact model of hands and objects at rest.

    skin        its compliance
    reach_mm    height above its top at which a switch touches: skin bulges, and a glove spreads the load
    most_steps  Newton steps before a repetition counts as not settled
    """

    skin: Skin = USUAL_SKIN
    reach_mm: float = REACH_MM
    most_steps: int = MOST_STEPS
    pace: SolverSettings = USUAL

    def solve(self, loads: Sequence[Load]) -> list[Contact]:
        """Return the rest of the hands (contact.ContactModel)."""
        solved: list[Contact] = []
        for _, same_hand in groupby(loads, key=lambda load: load.condition.hand.size):
            for together in _bundles(list(same_hand)):
                rests = close(together, self.skin, self.most_steps, self.pace)
                solved += [self._contact(load, rest) for load, rest in zip(together, rests, strict=True)]
        return solved

    def _contact(self, load: Load, rest: Rest) -> Contact:
        hand, shape = load.condition.hand, load.condition.thing.shape
        capsules = np.zeros((len(CAPSULES), len(load.grip_n)))
        for sphere, capsule in enumerate(hand.sphere_capsules):
            capsules[capsule] += rest.presses[sphere]
        tops = _switches(hand).tops(hand.skeleton(rest.angles))
        forces, between = split(_switches(hand), self.reach_mm - rest.pose.distance(shape, tops)[0], capsules)
        pose = np.concatenate([rest.pose.position, rotation_vector(rest.pose.rotation)])
        return Contact(
            posture_deg=rest.angles.T * (180.0 / np.pi),
            pose=pose.T,
            forces_n=forces.T,
            capsules_n=capsules.T,
            between_n=between,
            settled=rest.settled,
            residual_n=rest.residual_n,
            residual_nmm=rest.residual_nmm,
            steps=int(np.add.reduce(rest.steps)),
        )


@lru_cache(maxsize=8)
def _switches(hand: Hand) -> SwitchPlaces:
    return SwitchPlaces(hand, murakami160())


def _bundles(loads: list[Load]) -> list[list[Load]]:
    """Return the loads in bundles of about `_TOGETHER` repetitions."""
    bundles: list[list[Load]] = [[]]
    for load in loads:
        if bundles[-1] and sum(len(other.grip_n) for other in bundles[-1]) + len(load.grip_n) > _TOGETHER:
            bundles.append([])
        bundles[-1].append(load)
    return bundles


def model(
    setting: SceneSetting,
    *,
    press_n_per_mm: _Positive = USUAL_SKIN.press_n_per_mm,
    soft_mm: Annotated[float, msgspec.Meta(gt=0.0, le=5.0)] = USUAL_SKIN.soft_mm,
    drag_n_per_mm: _Positive = USUAL_SKIN.drag_n_per_mm,
    friction: Annotated[float, msgspec.Meta(ge=0.0, le=2.0)] = USUAL_SKIN.friction,
    reach_mm: Annotated[float, msgspec.Meta(ge=0.0, le=5.0)] = REACH_MM,
    most_steps: Annotated[int, msgspec.Meta(ge=1, le=1000)] = MOST_STEPS,
) -> ContactModel:
    """Return the contact model.

    press_n_per_mm, soft_mm  stiffness of each point of skin, and the depth of its softer first part
    drag_n_per_mm, friction  sideways, until it slips
    reach_mm, most_steps     `Quasistatic`
    """
    return Quasistatic(Skin(press_n_per_mm, soft_mm, drag_n_per_mm, friction), reach_mm, most_steps).solve


MEMBER = Effect(
    name="contact.quasistatic",
    summary="hand and object at rest: skin springs, sticking friction, weight",
    order=200,
    reads=CONTACT_READS,
    writes=CONTACT_WRITES,
    model=model,
)
