"""What an effect is: one record of one way to change a batch, in one module of `thenar.simulator.effects`.

Such a module holds three things:

    class Parameters(EffectParameters)         what a scene may set, with defaults and limits
    def prepare(parameters, setting) -> Step   everything that is done once; the step does the rest, batch by batch
    MEMBER = Effect(...)                       its name, where it belongs, what it reads and writes, and these two

A contact model has `model(parameters, setting) -> ContactModel` instead of `prepare`. An effect that asks the contact
model again has `together(parameters, setting, contact) -> Together`.

`Effect.name` is the key of the scene: [effects.joint.noise] is "joint.noise", in the module effects/joint_noise.py.
Other packages add effects by entry points in the group `thenar.effects`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import msgspec

from thenar.drivers.members import Members

from ..contact.model import ContactModel
from ..streams import Draw
from .batch import Batch

Stage = Literal["posture", "contact", "switch", "frame", "sense", "read", "wire"]
STAGES: tuple[Stage, ...] = ("posture", "contact", "switch", "frame", "sense", "read", "wire")

Step = Callable[[Batch, Draw], None]
# What is done with several batches at once, each with its draws.
Together = Callable[[Sequence[Batch], Sequence[Draw]], None]


class EffectParameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What every effect takes: names of effects that must act before it, beyond the usual order."""

    after: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Effect:
    """What the pipeline must know of an effect.

    place          among the effects of its stage, where nothing else decides
    reads, writes  fields of `Batch`
    after          effects that act before it when they are listed too
    conflicts      effects that cannot be listed beside it
    timed          True where the effect lives in time, so that whole streams of frames are simulated
    on_wire        True where it acts on bytes, so that frames are sent and received as bytes
    parameters     what a scene may set
    prepare, model, together   one of them makes what acts
    """

    name: str
    summary: str
    stage: Stage
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    place: int = 0
    after: tuple[str, ...] = ()
    conflicts: tuple[str, ...] = ()
    timed: bool = False
    on_wire: bool = False
    parameters: type[EffectParameters] = EffectParameters
    prepare: Callable[[Any, "Setting"], Step] | None = None
    model: Callable[[Any, "Setting"], ContactModel] | None = None
    together: Callable[[Any, "Setting", ContactModel], Together] | None = None

    @property
    def rank(self) -> tuple[int, int]:
        """Who goes first where nothing else decides."""
        return STAGES.index(self.stage), self.place


@dataclass(frozen=True, slots=True)
class Setting:
    """What of a scene the effects and the glove itself must know.

    seed, session_trials  trials of one subject's session
    threshold_n           what closes a switch (the paper: 1.0 N)
    period_us, first_us, hold_us, release_us   frames are scanned every period_us from first_us (the transition before
                          contact is negative) to hold_us, where the row is read out, and on through release_us more
    timed, on_wire        whether any effect of the scene is
    """

    seed: int
    session_trials: int
    threshold_n: float
    period_us: int
    first_us: int
    hold_us: int
    release_us: int
    timed: bool
    on_wire: bool


EFFECTS = Members("effect", Effect, "thenar.simulator.effects", "thenar.effects")
