"""Ports that answer no more: their sixteen switches read as open.

Their wires still carry current: in a matrix (switch.ghosting) their closed switches join the columns all the same.
"""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ..body.layout import murakami160
from ..errors import SceneError
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, EffectParameters, Setting, Step
from ..pipeline.parts import drawn, port_count, port_of
from ..streams import Draw

Bits = NDArray[np.bool_]


class Parameters(EffectParameters, frozen=True):
    """Either which ports are dead, from 0, or how many, drawn for the glove; one where neither is said."""

    ports: Annotated[tuple[Annotated[int, Meta(ge=0)], ...], Meta(min_length=1)] | None = None
    count: Annotated[int, Meta(ge=1)] | None = None

    def __post_init__(self) -> None:
        """Refuse both at once."""
        if self.ports is not None and self.count is not None:
            raise ValueError("say which `ports` are dead or their `count`, not both")


def prepare(parameters: Parameters, setting: Setting) -> Step:
    """Return the step that opens every switch of the dead ports. Raises SceneError where there are no such ports."""
    switches = len(murakami160())
    dead, port = _chooser(parameters, port_count(switches)), port_of(switches)

    def step(batch: Batch, draw: Draw) -> None:
        batch.bits = batch.bits & ~dead(draw)[port]

    return step


def _chooser(parameters: Parameters, there: int) -> Callable[[Draw], Bits]:
    """Return what tells which of the ports (there,) are dead."""
    if parameters.ports is not None:
        if max(parameters.ports) >= there:
            raise SceneError(
                f"effects.port.dead.ports: the glove has no port {max(parameters.ports)}: they go from 0 to {there - 1}"
            )
        named = np.isin(np.arange(there), parameters.ports)
        return lambda draw: named
    count = parameters.count or 1
    if count > there:
        raise SceneError(f"effects.port.dead.count: {count} ports cannot be dead: the glove has {there}")
    return lambda draw: drawn(draw, there, count)


MEMBER = Effect(
    name="port.dead",
    summary="whole ports read as open",
    stage="read",
    place=5,
    reads=("bits",),
    writes=("bits",),
    parameters=Parameters,
    prepare=prepare,
)
