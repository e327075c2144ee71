"""Parts of a glove: the wiring of switches, and faulty parts."""

from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from thenar.runtime.names import nearest

from ..body.layout import murakami160
from ..errors import SceneError
from ..streams import Draw

PORT = 16
_MANY = {"port": "ports", "switch": "switches"}


def port_count(switches: int) -> int:
    """Return the number of ports for `switches` switches."""
    return -(-switches // PORT)


def port_of(switches: int) -> NDArray[np.int64]:
    """Return the port (switches,) of each switch."""
    return np.arange(switches) // PORT


Bits = NDArray[np.bool_]


# The parameters of an effect that names faulty parts: their numbers from 0 or names, or how many are drawn.
SwitchList = Annotated[tuple[int | str, ...], Meta(min_length=1)] | None
Count = Annotated[int, Meta(ge=1)] | None


def stuck(effect: str, switches: SwitchList, count: Count) -> Callable[[Draw], Bits]:
    """Return a function for the mask (s,) of stuck switches: `switches`, by number or name, or `count` of them.

    Those that are only counted are drawn for the glove; one by default.

    Effects draw independently: two may draw the same switch. Raises SceneError if there is no such switch.
    """
    names, numbers = [patch.name for patch in murakami160()], list[int]()
    for switch in switches or ():
        if isinstance(switch, str) and switch not in names:
            raise SceneError(f"effects.{effect}.switches: the glove has no switch {switch!r}{nearest(switch, names)}")
        numbers.append(names.index(switch) if isinstance(switch, str) else switch)
    return chooser(effect, "switch", "stuck", len(names), numbers, count)


def chooser(
    effect: str, part: str, fault: str, total: int, numbers: Sequence[int], count: int | None
) -> Callable[[Draw], Bits]:
    """Return a function for the mask (total,) of faulty parts: those of these numbers, or `count` of them (None: one),
    those with the smallest uniform numbers. Raises SceneError if there are no such parts.
    """
    parts = _MANY[part]
    for number in numbers:
        if not 0 <= number < total:
            said = f"the glove has no {part} {number}: they go from 0 to {total - 1}"
            raise SceneError(f"effects.{effect}.{parts}: {said}")
    if numbers:
        named = np.isin(np.arange(total), numbers)
        return lambda draw: named
    if (count or 1) > total:
        raise SceneError(f"effects.{effect}.count: {count} {parts} cannot be {fault}: the glove has {total}")
    drawn = count or 1
    return lambda draw: np.isin(np.arange(total), np.argsort(draw.per_glove(total).uniform(), kind="stable")[:drawn])
