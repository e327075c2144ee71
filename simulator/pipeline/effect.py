"""What an effect is: one module of `thenar.simulator.effects` that changes a batch in one way.

Such a module holds three things:

    class Parameters(EffectParameters)         what a scene may set, with defaults and limits
    EFFECT = Effect(...)                       where it belongs, what it reads and writes
    def prepare(parameters, setting) -> Step   everything that is done once; the step does the rest, batch by batch

A contact model has `model(parameters, setting) -> ContactModel` instead, and contact.ramp's `prepare` is given it
and returns a `Together`.

`Effect.name` is the key of the scene: [effects.joint.noise] is "joint.noise", in the module effects/joint_noise.py.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import msgspec

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

    reads, writes  fields of `Batch`
    after          effects that act before it when they are listed too
    conflicts      effects that cannot be listed beside it
    timed          True where the effect lives in time, so that whole streams of frames are simulated
    on_wire        True where it acts on bytes, so that frames are sent and received as bytes
    """

    name: str
    summary: str
    stage: Stage
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    after: tuple[str, ...] = ()
    conflicts: tuple[str, ...] = ()
    timed: bool = False
    on_wire: bool = False


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
