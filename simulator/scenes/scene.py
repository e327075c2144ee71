"""Scenes: subjects, objects and repetitions, the glove, and the effects.

A scene comes from a TOML file (pipeline/scene_file.py) or is built here. Lengths are in millimetres, times in
milliseconds.

Every subject has separate draws, so that a larger count leaves the first subjects unchanged.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import floor, sqrt
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np

from thenar.runtime.names import nearest

from ..body.condition import Thing
from ..body.hand import Hand, Size
from ..body.layout import taxel_places
from ..body.shapes import Shape
from ..errors import SceneError
from ..streams import Draw, Site

# No hand is smaller or larger.
HAND_LENGTHS_MM = (130.0, 240.0)
HAND_BREADTHS_MM = (55.0, 115.0)
# An object broader than this in every direction fits no hand; the planner decides on smaller ones.
SPAN_MM = 200.0

Rest = Literal["relaxed", "flat"]
_Milliseconds = Annotated[float, msgspec.Meta(ge=0.0, le=60_000.0)]


class Subject(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A right hand: length from wrist crease to tip of the middle finger, breadth across the knuckles without thumb."""

    name: str
    hand_length_mm: Annotated[float, msgspec.Meta(ge=HAND_LENGTHS_MM[0], le=HAND_LENGTHS_MM[1])]
    hand_breadth_mm: Annotated[float, msgspec.Meta(ge=HAND_BREADTHS_MM[0], le=HAND_BREADTHS_MM[1])]

    def hand(self) -> Hand:
        """Return the hand model of this size."""
        return Hand(Size(self.hand_length_mm, self.hand_breadth_mm))


class SceneObject(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A grasped object, and its grasp type in the scene's taxonomy."""

    name: str
    grasp: str
    shape: Shape
    mass_g: Annotated[float, msgspec.Meta(gt=0.0, le=5000.0)]

    def __post_init__(self) -> None:
        if min(self.shape.extent_mm()) > SPAN_MM:
            raise ValueError(f"no hand holds an object of more than {SPAN_MM:g} mm in every direction")

    def thing(self) -> Thing:
        """Return the object for the contact models."""
        return Thing(self.name, self.shape, self.mass_g / 1000.0)


class Recording(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The recording of a grasp: frames at `rate_hz`, from `lead_ms` before contact through `hold_ms` of holding and
    `release_ms` more. A row of the set is the frame at the end of holding ("last"), or every frame ("all").

    With `rest` (True: "relaxed"), the hand opens after each release and rests for `rest_ms`.
    """

    rate_hz: Annotated[float, msgspec.Meta(ge=1.0, le=10_000.0)] = 100.0
    lead_ms: _Milliseconds = 0.0
    hold_ms: Annotated[float, msgspec.Meta(ge=1.0, le=60_000.0)] = 500.0
    release_ms: _Milliseconds = 0.0
    rows: Literal["last", "all"] = "last"
    rest: bool | Rest = False
    rest_ms: _Milliseconds = 500.0


class SceneGlove(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The glove: the layout and threshold of its switches, and whether joint codes are the sensors' bytes ("raw") or
    mapped by every subject's calibration to one scale ("common"). The places `taxels`, by their names or those of their
    segments, have taxels instead of switches.
    """

    layout: Literal["murakami160"] = "murakami160"
    threshold_n: Annotated[float, msgspec.Meta(gt=0.0, le=20.0)] = 1.0
    codes: Literal["common", "raw"] = "common"
    taxels: Literal["all"] | tuple[str, ...] = ()

    def __post_init__(self) -> None:
        taxel_places(self.taxels)


class ListedEffect(NamedTuple):
    """An effect that the scene lists, and its parameters by name, the usual ones included."""

    name: str
    parameters: tuple[tuple[str, Any], ...] = ()


class Scene(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All inputs of a simulation.

    taxonomy     a published one
    objects      at least one for every grasp type of the taxonomy
    repetitions  of every grasp type by every subject, shared evenly by the type's objects
    done         earlier repetitions: the numbers and trials of these follow
    effects      by their order, at most one contact model among them
    """

    name: str
    seed: int
    taxonomy: str
    objects: tuple[SceneObject, ...]
    subjects: tuple[Subject, ...]
    repetitions: int
    recording: Recording = Recording()
    glove: SceneGlove = SceneGlove()
    effects: tuple[ListedEffect, ...]
    done: int = 0

    def varied(
        self,
        repetitions: int | None = None,
        seed: int | None = None,
        subjects: Sequence[str] = (),
        more: int | None = None,
        rest: Rest | None = None,
        first: int | None = None,
    ) -> "Scene":
        """Return the scene with other repetitions, another seed, only the `subjects` of these names, or another `rest`.

        With `more`, it has this many new repetitions instead, by the same hands, which follow its own; with `first`,
        only that many of these subjects. Another seed changes all draws except the sizes of the hands. Raises
        SceneError if it has no such subject, or fewer.
        """
        if first is not None and first > len(self.subjects):
            raise SceneError(f"scene {self.name} has {len(self.subjects)} subject(s), {first} are requested")
        known = {subject.name: subject for subject in self.subjects}
        for subject in subjects:
            if subject not in known:
                raise SceneError(f"scene {self.name} has no subject {subject!r}{nearest(subject, list(known))}")
        listed = self.repetitions if repetitions is None else repetitions
        return msgspec.structs.replace(
            self,
            repetitions=listed if more is None else more,
            done=self.done if more is None else self.done + listed,
            seed=self.seed if seed is None else seed,
            subjects=tuple(known[name] for name in known if not subjects or name in subjects)[:first],
            recording=msgspec.structs.replace(self.recording, rest=rest or self.recording.rest),
        )

    @property
    def types(self) -> int:
        """Number of grasp types."""
        return len({item.grasp for item in self.objects})

    @property
    def origin(self) -> str:
        """The origin of its grasps, stored in the set."""
        numbers = f", {self.repetitions} more after {self.done} repetitions" if self.done else ""
        return f"scene {self.name}, seed {self.seed}{numbers}"

    def shares(self) -> Iterator[tuple[SceneObject, range]]:
        """Yield every object with the numbers of its repetitions; a type's first objects share the remainder."""
        grasps = [item.grasp for item in self.objects]
        for number, item in enumerate(self.objects):
            count, place = grasps.count(item.grasp), grasps[:number].count(item.grasp)
            ends = (self.done, self.done + self.repetitions)
            yield item, range(*(end // count + (place < end % count) for end in ends))


SITE = "population"
# Between length and breadth of a hand: AIST 1991-92.
CORRELATION = 0.79


@dataclass(frozen=True, slots=True)
class SizeSpread:
    """A measure of many hands in mm: its mean and standard deviation."""

    mean: float
    sd: float

    def at(self, normal: float, limits: tuple[float, float]) -> float:
        """Return the size `normal` deviations from the mean, inside `limits`, to a tenth of a millimetre."""
        return min(max(round(self.mean + self.sd * normal, 1), limits[0]), limits[1])


# Length and breadth of men, then of women. Published: lengths of the US Army (ANSUR II, NATICK/TR-15/007), lengths from
# the radial styloid (some 6 mm more than from the wrist crease) and mean breadths of Japan (AIST 2012). Ours: ANSUR's
# mean breadths, 0.455 of the mean lengths, and the spread of all breadths.
_BREADTH_SD = 4.0
SURVEYS = {
    "ansur2": (
        (SizeSpread(193.3, 9.9), SizeSpread(0.455 * 193.3, _BREADTH_SD)),
        (SizeSpread(181.1, 10.1), SizeSpread(0.455 * 181.1, _BREADTH_SD)),
    ),
    "aist2012": (
        (SizeSpread(189.6, 8.1), SizeSpread(83.3, _BREADTH_SD)),
        (SizeSpread(175.4, 7.3), SizeSpread(74.4, _BREADTH_SD)),
    ),
}


class SurveyPopulation(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Subjects of a survey, men and women mixed evenly to the share of women."""

    survey: Literal["ansur2", "aist2012"]
    count: Annotated[int, msgspec.Meta(ge=1, le=10_000)]
    women: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.5


def draw_subjects(population: SurveyPopulation, seed: int) -> tuple[Subject, ...]:
    """Return the subjects P001, P002, ... of a population."""
    return tuple(_subject(population, seed, number) for number in range(population.count))


def _subject(population: SurveyPopulation, seed: int, number: int) -> Subject:
    name = f"P{number + 1:03d}"
    site = Site(name, "", "", np.zeros(1, dtype=np.int64))
    first, second = Draw(seed, SITE, site, Counter()).per_subject(2).normal().tolist()
    woman = floor((number + 1) * population.women) > floor(number * population.women)
    length, breadth = SURVEYS[population.survey][woman]
    across = CORRELATION * first + sqrt(1.0 - CORRELATION * CORRELATION) * second
    return Subject(
        name=name,
        hand_length_mm=length.at(first, HAND_LENGTHS_MM),
        hand_breadth_mm=breadth.at(across, HAND_BREADTHS_MM),
    )
