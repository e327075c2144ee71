"""contact.quasistatic: hand and object at rest, in numpy. The default contact model of a scene."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import groupby
from typing import Annotated

import msgspec
import numpy as np

from ..body.hand import CAPSULES, Hand
from ..body.layout import SwitchPlaces, murakami160
from ..body.shapes import rotation_vector
from ..contact.balance import USUAL, Skin, SolverCase, SolverSettings
from ..contact.model import Contact, ContactModel, Load, split
from ..contact.settle import Rest, close
from ..pipeline.effect import CONTACT_READS, CONTACT_WRITES, Effect, EffectParameters, SceneSetting

_Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]
# Repetitions solved at a time: enough to amortise numpy's calls, few enough for the processor's cache.
_TOGETHER = 512


class Parameters(EffectParameters, frozen=True):
    """The compliance of skin, and the limit of steps. Defaults are ours, of the order of published finger pulp.

    press_n_per_mm, soft_mm  stiffness of each point of skin, and the depth of its softer first part
    drag_n_per_mm, friction  sideways, until it slips
    reach_mm                 height above its top at which a switch touches: skin bulges, and a glove spreads the load
    most_steps               Newton steps before a repetition counts as not settled
    """

    press_n_per_mm: _Positive = 3.0
    soft_mm: Annotated[float, msgspec.Meta(gt=0.0, le=5.0)] = 0.5
    drag_n_per_mm: _Positive = 1.5
    friction: Annotated[float, msgspec.Meta(ge=0.0, le=2.0)] = 0.8
    reach_mm: Annotated[float, msgspec.Meta(ge=0.0, le=5.0)] = 1.0
    most_steps: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 40


class Quasistatic:
    """The contact model of hands and objects at rest."""

    def __init__(self, parameters: Parameters, pace: SolverSettings = USUAL) -> None:
        self.pace = pace
        self.skin = Skin(parameters.press_n_per_mm, parameters.soft_mm, parameters.drag_n_per_mm, parameters.friction)
        self.reach_mm, self.most_steps = parameters.reach_mm, parameters.most_steps

    def solve(self, loads: Sequence[Load]) -> list[Contact]:
        """Return the rest of the hands (contact.ContactModel)."""
        solved: list[Contact] = []
        for _, same_hand in groupby(loads, key=lambda load: load.condition.hand.size):
            for together in _bundles(list(same_hand)):
                cases = [
                    SolverCase(load.condition, load.posture_deg.T * (np.pi / 180.0), load.pose.T, load.grip_n)
                    for load in together
                ]
                rests = close(cases, self.skin, self.most_steps, self.pace)
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


def model(parameters: Parameters, setting: SceneSetting) -> ContactModel:
    """Return the contact model."""
    return Quasistatic(parameters)


MEMBER = Effect(
    name="contact.quasistatic",
    summary="hand and object at rest: skin springs, sticking friction, weight",
    order=200,
    reads=CONTACT_READS,
    writes=CONTACT_WRITES,
    parameters=Parameters,
    model=model,
)
