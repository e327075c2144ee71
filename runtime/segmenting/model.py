"""The explicit-duration hidden Markov model of a build: small integer costs of frames, durations and transitions.

States are the grasp types, 0 to K - 1, and "none", the last, K. Costs are steps of negative logarithms, usually
`STEPS` to a nat, and the best segmentation of a stream is the cheapest one:

    a frame costs state k   min(((best - score_k) >> shift) * gain >> 8, most)
    each of its ticks       stay[k] more; it lasts least[k] ticks or more, unless the stream begins or ends in it
    a type k begins         enter[k] after none, direct[k] after another type
    none begins             leave[k] after type k

The first segment begins at no cost.
"""

from typing import Annotated, Self

from msgspec import Meta, Struct

from ..errors import BuildError

STEPS = 16
# Differences of path costs fit a signed 16-bit integer: firmware keeps the costs modulo 2^16.
LARGEST = 32767
_MOST = 254

Cost = Annotated[int, Meta(ge=0, le=4095)]
Ticks = Annotated[int, Meta(ge=1, le=255)]


class SegmentModel(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """Costs of segments. Raises BuildError if they do not fit together, or if paths could differ by more than int16.

    Parameters
    ----------
    shift, gain, most : int
        The cost of a frame for a state (see the module); `gain_of` makes the first two.
    least : tuple of int, length K + 1
        The shortest duration of each state, in ticks.
    stay : tuple of int, length K + 1
        The cost of each tick of a segment, so that durations beyond the shortest decay geometrically.
    enter, leave, direct : tuple of int, length K
        The cost of a type after none, of none after a type, of a type after another type.
    refusal : int or None
        None: the tables have a class "none". Otherwise none costs nothing in a refused frame, in which every type costs
        this amount more; in all other frames none costs this amount.
    tick_us : int
        The time of a tick.
    """

    shift: Annotated[int, Meta(ge=0, le=8)]
    gain: Annotated[int, Meta(ge=1, le=65535)]
    most: Annotated[int, Meta(ge=1, le=_MOST)]
    least: tuple[Ticks, ...]
    stay: tuple[Cost, ...]
    enter: Annotated[tuple[Cost, ...], Meta(min_length=1)]
    leave: tuple[Cost, ...]
    direct: tuple[Cost, ...]
    refusal: Cost | None = None
    tick_us: Annotated[int, Meta(ge=100, le=1_000_000)] = 10_000

    def __post_init__(self) -> None:
        n_types = len(self.enter)
        held = len(self.leave), len(self.direct), len(self.least) - 1, len(self.stay) - 1
        if n_types < 1 or set(held) != {n_types}:
            raise BuildError(
                f"a segment model enters {n_types} types, and leaves {held[0]}, directly {held[1]}; "
                f"its durations are of {held[2]} types and none"
            )
        costs = (*self.stay, *self.enter, *self.leave, *self.direct, self.refusal or 0)
        if min(costs) < 0 or not 1 <= min(self.least) <= max(self.least) <= 255:
            raise BuildError("a segment model has a cost below 0, or a shortest duration that is not 1 to 255 ticks")
        if not (0 <= self.shift <= 8 and 1 <= self.gain <= 65535 and 1 <= self.most <= _MOST):
            raise BuildError(
                f"a frame cannot cost (difference >> {self.shift}) * {self.gain} >> 8, at most {self.most}"
            )
        if self.shift < 8 and 255 * self.gain >> 8 < self.most:
            raise BuildError(
                f"a gain of {self.gain} takes a byte to {255 * self.gain >> 8}, below {self.most}, "
                f"the most that a frame costs"
            )
        if self.spread > LARGEST:
            raise BuildError(
                f"paths through this segment model may differ by {self.spread} steps, at most {LARGEST} fit: "
                f"use shorter durations than {max(self.least)} ticks, or longer ticks"
            )

    @classmethod
    def usual(cls, n_types: int, has_none: bool, scale: float) -> Self:
        """Return a default model for tables of `scale` steps per unit, for builds not trained on streams.

        Grasps last at least 100 ms, none at least 50 ms; three frames that are certain begin a grasp.
        """
        shift, gain = gain_of(scale, 0.25)
        return cls(
            shift=shift,
            gain=gain,
            most=48,
            least=(10,) * n_types + (5,),
            stay=(0,) * (n_types + 1),
            enter=(80,) * n_types,
            leave=(48,) * n_types,
            direct=(160,) * n_types,
            refusal=None if has_none else 24,
        )

    @property
    def n_types(self) -> int:
        """K, which is also the number of the state none."""
        return len(self.enter)

    @property
    def n_lanes(self) -> int:
        """The number of scores per frame: K, plus one if the tables have a class "none"."""
        return self.n_types + (self.refusal is None)

    @property
    def spread(self) -> int:
        """The largest difference that the decoder compares.

        Let P be the most that a tick costs, L the longest of the shortest durations, X the most expensive transition,
        V(t) the cheapest path to tick t: a path's beginning is a path, so V never falls. If the cheapest path is in a
        segment that is not complete, the state before it could have gone on, for (L - 1) P at most: so the cheapest of
        the states that may be left at t costs at most V(t) + (L - 1) P. From there any state can be complete L ticks
        later, for X + L P. So all states lie within X + (2 L - 1) P of each other, and entering states are X away from
        them.
        """
        tick = self.most + max(self.stay) + (self.refusal or 0)
        change = max(*self.enter, *self.leave, *self.direct)
        return 2 * change + (2 * max(self.least) - 1) * tick


def gain_of(scale: float, temperature: float) -> tuple[int, int]:
    """Return `shift` and `gain` for tables of `scale` steps per unit: score differences times `temperature`, in steps
    of 1 / `STEPS`.
    """
    factor = STEPS * temperature / scale
    shift = max((shift for shift in range(9) if round(factor * 2.0 ** (8 + shift)) <= 255), default=0)
    return shift, min(max(round(factor * 2.0 ** (8 + shift)), 1), 65535)
