"""Which effects there are, by name. Naming them here imports none of them."""

import difflib
from importlib import import_module
from types import ModuleType

from .errors import SceneError

# In the order in which they act where nothing else decides.
NAMES = (
    "hand.style",
    "hand.posture",
    "hand.object_pose",
    "hand.grip",
    "contact.quasistatic",
    "contact.mujoco",
    "switch.threshold",
    "contact.ramp",
    "frame.jitter",
    "bus.latency",
    "hand.transition",
    "joint.noise",
    "joint.drift",
    "switch.bounce",
    "switch.stuck_open",
    "switch.stuck_closed",
    "switch.ghosting",
    "port.dead",
    "wire.lost_bytes",
    "wire.damaged_bytes",
)
CONTACTS = ("contact.quasistatic", "contact.mujoco")


def load(name: str) -> ModuleType:
    """Import and return the module of effect `name`. Raises SceneError naming the nearest where there is none."""
    if name not in NAMES:
        near = difflib.get_close_matches(name, NAMES, n=1)
        raise SceneError(
            f"there is no effect {name!r}"
            + (f": did you mean {near[0]!r}?" if near else f"; there are {', '.join(NAMES)}")
        )
    return import_module(f".effects.{name.replace('.', '_')}", __package__)
