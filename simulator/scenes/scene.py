"""What a scene is: whose hands grasp which objects how often, what the glove is like, and which effects act.

A scene comes from a TOML file (decode.py) or is put together here; lengths are in millimetres, times in milliseconds.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import msgspec

from ..body.anthropometry import Size
from ..body.condition import Thing
from ..body.hand import Hand
from ..body.shapes import Shape
from ..pipeline.effect import Effect, EffectParameters, Setting

# No hand is smaller or larger.
HAND_LENGTHS_MM = (130.0, 240.0)
HAND_BREADTHS_MM = (55.0, 115.0)
# An object that is broader than this wherever it is held fits no hand; whether a smaller one fits is planned.
SPAN_MM = 200.0

_Milliseconds = Annotated[float, msgspec.Meta(ge=0.0, le=60_000.0)]


class Subject(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Somebody's right hand: wrist crease to tip of the middle finger, and across the knuckles without the thumb."""

    name: str
    hand_length_mm: Annotated[float, msgspec.Meta(ge=HAND_LENGTHS_MM[0], le=HAND_LENGTHS_MM[1])]
    hand_breadth_mm: Annotated[float, msgspec.Meta(ge=HAND_BREADTHS_MM[0], le=HAND_BREADTHS_MM[1])]

    def hand(self) -> Hand:
        """Return the hand model of this size."""
        return Hand(Size(self.hand_length_mm, self.hand_breadth_mm))


class SceneObject(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is grasped, and by which grasp type of the scene's taxonomy."""

    name: str
    grasp: str
    shape: Shape
    mass_g: Annotated[float, msgspec.Meta(gt=0.0, le=5000.0)]

    def __post_init__(self) -> None:
        if min(self.shape.extent_mm()) > SPAN_MM:
            raise ValueError(f"no hand holds what is more than {SPAN_MM:g} mm across in every direction")

    def thing(self) -> Thing:
        """Return what the contact models know of it."""
        return Thing(self.name, self.shape, self.mass_g / 1000.0)


class Recording(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a grasp is recorded: frames at `rate_hz`, from `lead_ms` before contact through `hold_ms` of holding and
    `release_ms` more. A row of the set is the frame at the end of holding ("last"), or every frame ("all").
    """

    rate_hz: Annotated[float, msgspec.Meta(ge=1.0, le=10_000.0)] = 100.0
    lead_ms: _Milliseconds = 0.0
    hold_ms: Annotated[float, msgspec.Meta(ge=1.0, le=60_000.0)] = 500.0
    release_ms: _Milliseconds = 0.0
    rows: Literal["last", "all"] = "last"


class Glove(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The glove: where its switches lie, what closes them, and whether joint codes are the sensors' bare bytes ("raw")
    or mapped through every subject's calibration to one scale ("common").
    """

    layout: Literal["murakami160"] = "murakami160"
    threshold_n: Annotated[float, msgspec.Meta(gt=0.0, le=20.0)] = 1.0
    codes: Literal["common", "raw"] = "common"


class Listed(NamedTuple):
    """An effect that the scene asks for."""

    name: str
    parameters: EffectParameters


class Scene(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Everything that decides what comes out of a simulation.

    taxonomy     a published one
    objects      at least one for every grasp type of the taxonomy
    repetitions  of every grasp type by every subject, shared evenly by the type's objects
    effects      in the order of the registry EFFECTS, one contact model among them
    postures     a file of planned postures for objects that are not shipped
    """

    name: str
    seed: int
    taxonomy: str
    objects: tuple[SceneObject, ...]
    subjects: tuple[Subject, ...]
    repetitions: int
    recording: Recording = Recording()
    glove: Glove = Glove()
    effects: tuple[Listed, ...]
    postures: Path | None = None

    def setting(self, effects: Iterable[Effect]) -> Setting:
        """Return what `effects`, those of this scene, must know of it."""
        effects, recording = tuple(effects), self.recording
        return Setting(
            seed=self.seed,
            session_trials=self.repetitions * len({item.grasp for item in self.objects}),
            threshold_n=self.glove.threshold_n,
            period_us=round(1e6 / recording.rate_hz),
            first_us=-round(recording.lead_ms * 1000),
            hold_us=round(recording.hold_ms * 1000),
            release_us=round(recording.release_ms * 1000),
            # Whoever wants every frame wants frames, whether or not an effect lives in time.
            timed=recording.rows == "all" or any(effect.timed for effect in effects),
            on_wire=any(effect.on_wire for effect in effects),
        )

    def shares(self) -> Iterator[tuple[SceneObject, int]]:
        """Yield every object with its repetitions; of what does not go out, a type's first objects get one each."""
        grasps = [item.grasp for item in self.objects]
        for number, item in enumerate(self.objects):
            count, place = grasps.count(item.grasp), grasps[:number].count(item.grasp)
            yield item, self.repetitions // count + (place < self.repetitions % count)
