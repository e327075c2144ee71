"""Effects: the record of one change of a batch, and the order of effects and the glove's own steps.

An effect's module holds two things:

    def prepare(setting, *, sd_deg: float = 2.0) -> Step   the one-time work; the step does the rest, batch by batch
    MEMBER = Effect(...)                                   its name, order, fields that it reads and writes, and this

The keyword arguments of `prepare` are the parameters of a scene, with defaults and limits (msgspec.Meta).

A contact model has `model(setting, *, ...) -> ContactModel` instead of `prepare`. An effect that calls the contact
model again has `together(setting, contact, *, ...) -> Together`.

`Effect.name` is the key of the scene: [effects.joint.noise] is "joint.noise", in the module effects/joint_noise.py.
Other packages add effects by entry points of that name in the group `thenar.effects`.

Steps act in the order of their numbers, effects and the glove's own alike:

    1xx  the hand takes its posture             5xx  sensors follow the hand, taxels are pressed
    2xx  it closes on the object                7xx  switches and taxels are read
    3xx  switches close                         8xx  bytes travel
    4xx  frames get their times
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from inspect import Parameter, signature
from typing import get_type_hints

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.drivers.members import MembersByName

from ..body.layout import taxel_places
from ..contact.model import ContactModel
from ..scenes.scene import Scene
from ..streams import Draw
from .batch import Batch, Integers

# The fields of a batch that a contact model reads and writes (`Batch.load`, `Batch.take`).
CONTACT_READS = ("posture_deg", "pose", "grip_n")
CONTACT_WRITES = (
    *("posture_deg", "pose", "commanded_deg", "commanded_pose", "forces_n"),
    *("settled", "residual_n", "residual_nmm", "between_n"),
)

Step = Callable[[Batch, Draw], None]
# A step on several batches at once, each with its draws.
Together = Callable[[Sequence[Batch], Sequence[Draw]], None]


@dataclass(frozen=True, slots=True)
class Effect:
    """The record of an effect for the pipeline.

    order          a number: steps with lower ones act before it
    reads, writes  fields of `Batch`
    timed          True if the effect depends on time, so that whole streams of frames are simulated
    on_wire        True if it acts on bytes, so that frames are sent and received as bytes
    either         parameters of which a scene gives at most one
    prepare, model, together   one of them creates the step; its keyword arguments are the parameters of a scene
    """

    name: str
    summary: str
    order: int
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    timed: bool = False
    on_wire: bool = False
    either: tuple[str, ...] = ()
    prepare: Callable[..., Step] | None = None
    model: Callable[..., ContactModel] | None = None
    together: Callable[..., Together] | None = None

    def parameters(self) -> type[msgspec.Struct]:
        """Return the struct of the parameters of a scene, which checks them."""
        function = self.prepare or self.model or self.together
        assert function is not None
        kinds = get_type_hints(function, include_extras=True)
        fields = [
            (name, kinds[name], argument.default)
            for name, argument in signature(function).parameters.items()
            if argument.kind is Parameter.KEYWORD_ONLY
        ]
        return msgspec.defstruct(self.name, fields, frozen=True, forbid_unknown_fields=True, kw_only=True)


@dataclass(frozen=True, slots=True)
class SceneSetting:
    """The properties of a scene that effects and the glove's own steps need.

    seed, session_trials  trials of one subject's session
    threshold_n           closing force of a switch (the paper: 1.0 N)
    period_us, first_us, hold_us, release_us   frames are scanned every period_us from first_us (the transition before
                          contact is negative) to hold_us, where the row is read out, and on through release_us more
    timed, on_wire        whether any effect of the scene is
    taxels                numbers of the places that bear taxels, not switches
    every_frame           whether every frame becomes a row
    rest, rest_us         the posture (`RESTS_DEG`) of the rest between grasps, and its duration; None: no rest
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
    taxels: tuple[int, ...] = ()
    every_frame: bool = False
    rest: str | None = None
    rest_us: int = 0

    @classmethod
    def of(cls, scene: Scene, effects: Iterable[Effect]) -> "SceneSetting":
        """Return the properties of a scene that its `effects` need."""
        effects, recording = tuple(effects), scene.recording
        return cls(
            seed=scene.seed,
            session_trials=(scene.done or scene.repetitions) * scene.types,
            threshold_n=scene.glove.threshold_n,
            period_us=round(1e6 / recording.rate_hz),
            first_us=-round(recording.lead_ms * 1000),
            hold_us=round(recording.hold_ms * 1000),
            release_us=round(recording.release_ms * 1000),
            # Every frame as a row requires frames, even if no effect depends on time.
            timed=recording.rows == "all" or any(effect.timed for effect in effects),
            on_wire=any(effect.on_wire for effect in effects),
            taxels=taxel_places(scene.glove.taxels),
            every_frame=recording.rows == "all",
            rest=("relaxed" if recording.rest is True else recording.rest) or None,
            rest_us=round(recording.rest_ms * 1000),
        )

    @property
    def released_us(self) -> int:
        """The end of the release, when the hand goes to its rest."""
        return self.hold_us + self.release_us

    @property
    def let_go_us(self) -> int | None:
        """The time of the release: the start of the frame after the read-out, so that a row that takes long to read is
        complete. None if the recording ends before.
        """
        return self.hold_us + self.period_us if self.release_us > 0 else None


# A scene imports only the effects that it lists.
EFFECTS = MembersByName("effect", Effect, "thenar.simulator.effects", "thenar.effects")


# The most frames simulated at a time: with all derived data, each takes two to five kilobytes.
_MOST = 50_000


def frame_times(setting: SceneSetting) -> Integers:
    """Return the start times of the frames (F,) of a repetition, in microseconds from first contact.

    They are aligned with the one at hold_us, whose row is read out, so it is always among them. If nothing depends on
    time, it is the only one.
    """
    if not setting.timed:
        return np.array([setting.hold_us], dtype=np.int64)
    # The hand takes as long to its rest as from it.
    away_us = 0 if setting.rest is None else setting.rest_us - setting.first_us
    after = (setting.release_us + away_us) // setting.period_us
    return setting.hold_us + setting.period_us * np.arange(-hold_frame(setting), after + 1, dtype=np.int64)


def hold_frame(setting: SceneSetting) -> int:
    """Return the number of the frame at hold_us."""
    return (setting.hold_us - setting.first_us) // setting.period_us if setting.timed else 0


def at_a_time(setting: SceneSetting, repetitions: int) -> int:
    """Return the number of repetitions simulated at a time, `repetitions` if they have one frame each.

    With many frames each it is fewer, to limit the memory, but at least one.
    """
    return max(min(repetitions, _MOST // len(frame_times(setting))), 1)


def drawn_rows(setting: SceneSetting) -> NDArray[np.intp]:
    """Return the row of a repetition's random numbers for each frame (F,).

    The frame at hold_us takes the first, so that its numbers do not depend on other frames; frames after the release
    take the last, so that a rest does not change the numbers of the others.
    """
    times, read_out = frame_times(setting), hold_frame(setting)
    frames, moving = np.arange(len(times), dtype=np.intp), int((times <= setting.released_us).sum())
    return np.where(frames < moving, (frames - read_out) % moving, frames)
