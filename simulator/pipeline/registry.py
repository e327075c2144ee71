"""Which effects there are, by name. Naming them here imports none of them."""

from importlib import import_module
from types import ModuleType

from thenar.compiler.recordings.names import nearest

from ..errors import SceneError

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
    """Import and return the module of effect `name`. Raises SceneError naming what is near where there is none."""
    if name not in NAMES:
        raise SceneError(f"there is no effect {name!r}{nearest(name, NAMES)}")
    return import_module(f"..effects.{name.replace('.', '_')}", __package__)
