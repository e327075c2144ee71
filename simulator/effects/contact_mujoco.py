"""contact.mujoco: the hand closes on the object in MuJoCo, with friction and in time (extra `sim`)."""

from typing import Annotated

import msgspec
from msgspec import Meta

from thenar.drivers.extras import optional

from ..body.layout import murakami160
from ..contact.model import ContactModel
from ..pipeline.effect import CONTACT_READS, CONTACT_WRITES, Effect, EffectParameters, Setting


class Parameters(EffectParameters, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The time step, and the parameters of skin, friction and the hold on the object.

    dt_ms, steps     60 steps of 5 ms come closer to rest than 100 of 2 ms, and cost less; a grasp that fails because of
                     too long steps is reported as not settled
    friction         of skin on objects: ours, of the order measured on dry fingertips (0.5 to 1.5)
    skin_n_per_mm    stiffness of the skin of one capsule: ours, of the order measured on finger pulps pressed by a few
                     newtons
    reach_mm         a switch shares the force on its capsule if its top is at most this far from the object: the glove
                     bridges the difference, as in contact.quasistatic
    weld_n_per_m, weld_nm_per_rad    the hold of the object at its commanded pose; with a soft one a pinched object
                     creeps
    """

    dt_ms: Annotated[float, Meta(gt=0.0, le=10.0)] = 5.0
    steps: Annotated[int, Meta(ge=1, le=10_000)] = 60
    friction: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.8
    skin_n_per_mm: Annotated[float, Meta(gt=0.0, le=20.0)] = 2.0
    reach_mm: Annotated[float, Meta(ge=0.0, le=5.0)] = 1.0
    weld_n_per_m: Annotated[float, Meta(gt=0.0, le=20_000.0)] = 3000.0
    weld_nm_per_rad: Annotated[float, Meta(gt=0.0, le=20.0)] = 5.0


def model(parameters: Parameters, setting: Setting) -> ContactModel:
    """Return the contact model. Raises MissingPackageError without MuJoCo; reading a scene does not need it."""
    with optional(place="contact.mujoco"):
        from ..contact.mujoco import Dynamics, MujocoContact
    given = msgspec.structs.asdict(parameters)
    del given["after"]
    return MujocoContact(Dynamics(**given), murakami160())


MEMBER = Effect(
    name="contact.mujoco",
    summary="the hand closes on the object in MuJoCo: rigid bodies, friction, time",
    stage="contact",
    place=2,
    reads=CONTACT_READS,
    writes=CONTACT_WRITES,
    conflicts=("contact.quasistatic",),
    parameters=Parameters,
    model=model,
)
