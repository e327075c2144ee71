"""Switches that are not read simultaneously: sixteen per port, one port after the other over the bus."""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import log

from ..body.layout import murakami160
from ..errors import SceneError
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step, drawn_rows
from ..pipeline.parts import port_count, port_of
from ..streams import Draw


def prepare(
    setting: SceneSetting,
    *,
    us_per_port: Annotated[int, Meta(gt=0, le=1_000_000)] = 121,
    jitter_us: Annotated[float, Meta(ge=0.0, le=1e6)] = 0.0,
) -> Step:
    """Return the step that sets the delay of each switch from the frame's start: the end of its port's reading.

    Raises SceneError if all ports together take longer than the period of frames.

    Microseconds to read one port, and the mean of an additional exponential delay.

    The default is one MCP23017 at 400 kHz: 5 bytes on the wire are 48 clocks, and the bus must then be free for 1.3 us.
    """
    there = port_count(len(murakami160()))
    scan_us = there * (us_per_port + jitter_us)
    if scan_us > setting.period_us:
        raise SceneError(
            f"effects.bus.latency: {there} ports take {scan_us:g} µs on average, and the period of frames is"
            f" {setting.period_us} µs: lower us_per_port, jitter_us or recording.rate_hz"
        )
    rows = drawn_rows(setting)

    def step(batch: Batch, draw: Draw) -> None:
        switches = batch.on_us.shape[1]
        if not jitter_us:
            batch.delay_us = (port_of(switches) + 1) * us_per_port
            return
        chances = draw.per_repetition(len(rows), port_count(switches)).uniform()[:, rows]
        longer = np.rint(-jitter_us * log(chances)).astype(np.int64)
        batch.delay_us = np.cumsum(us_per_port + longer, axis=2)[:, :, port_of(switches)]

    return step


MEMBER = Effect(
    name="bus.latency",
    summary="ports are read one after the other",
    order=430,
    reads=("on_us",),
    writes=("delay_us",),
    timed=True,
    prepare=prepare,
)
