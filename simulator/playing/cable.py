"""What a scene's wire effects do to the messages of an emulated serial line."""

from collections.abc import Callable

import numpy as np

from ..effects import wire_damaged_bytes, wire_lost_bytes
from ..scenes.scene import Scene

Cable = Callable[[bytes], bytes]


def cable_of(scene: Scene, line: int) -> Cable | None:
    """Return what the cable of line number `line` does to a message on its way out; None where the scene lists nothing.

    The draws of every line are its own, and the same for the same seed.
    """
    rates = {listed.name: listed.parameters for listed in scene.effects}
    lost, damaged = rates.get(wire_lost_bytes.MEMBER.name), rates.get(wire_damaged_bytes.MEMBER.name)
    if lost is None and damaged is None:
        return None
    random = np.random.Generator(np.random.Philox(key=[scene.seed, line]))

    def cable(message: bytes) -> bytes:
        data = np.frombuffer(message, dtype=np.uint8)
        if isinstance(damaged, wire_damaged_bytes.Parameters):
            data = wire_damaged_bytes.damaged(data, random.random(len(data)), damaged.rate)
        if isinstance(lost, wire_lost_bytes.Parameters):
            data = data[wire_lost_bytes.arrives(random.random(len(data)), lost.rate)]
        return data.tobytes()

    return cable
