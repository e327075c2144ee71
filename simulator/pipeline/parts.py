"""Parts of a glove: how switches are wired, and which of them are faulty."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from thenar.runtime.names import nearest

from ..body.layout import murakami160
from ..errors import SceneError
from ..streams import Draw
from .effect import EffectParameters

PORT = 16


def port_count(switches: int) -> int:
    """Return how many ports so many switches need."""
    return -(-switches // PORT)


def port_of(switches: int) -> NDArray[np.int64]:
    """Return the port (switches,) of each switch."""
    return np.arange(switches) // PORT


Bits = NDArray[np.bool_]


class StuckParameters(EffectParameters, frozen=True):
    """Either `switches`, by number from 0 or by name, or their `count`, drawn for the glove; one where neither is said.

    Each effect draws by itself: a switch may be drawn by two.
    """

    switches: Annotated[tuple[int | str, ...], Meta(min_length=1)] | None = None
    count: Annotated[int, Meta(ge=1)] | None = None

    def __post_init__(self) -> None:
        """Refuse both at once."""
        if self.switches is not None and self.count is not None:
            raise ValueError("say which `switches` are stuck or their `count`, not both")


def chooser(effect: str, parameters: StuckParameters) -> Callable[[Draw], Bits]:
    """Return what tells which switches (s,) of the glove are stuck. Raises SceneError where it has no such switch."""
    names = [patch.name for patch in murakami160()]
    stuck = np.zeros(len(names), dtype=np.bool_)
    if parameters.switches is not None:
        stuck[[_number(effect, switch, names) for switch in parameters.switches]] = True
        return lambda draw: stuck
    count = parameters.count or 1
    if count > len(names):
        raise SceneError(f"effects.{effect}.count: {count} switches cannot be stuck: the glove has {len(names)}")
    return lambda draw: drawn(draw, len(names), count)


def drawn(draw: Draw, there: int, count: int) -> Bits:
    """Return which `count` of the glove's parts (there,) are drawn: those of the least uniform numbers."""
    least = np.argsort(draw.per_glove(there).uniform(), kind="stable")[:count]
    return np.isin(np.arange(there), least)


def _number(effect: str, switch: int | str, names: list[str]) -> int:
    if isinstance(switch, str):
        if switch not in names:
            raise SceneError(f"effects.{effect}.switches: the glove has no switch {switch!r}{nearest(switch, names)}")
        return names.index(switch)
    if not 0 <= switch < len(names):
        raise SceneError(
            f"effects.{effect}.switches: the glove has no switch {switch}: they go from 0 to {len(names) - 1}"
        )
    return switch
