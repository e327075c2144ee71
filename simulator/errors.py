"""What can go wrong between a scene and its grasps."""

from thenar.drivers.errors import ThenarError

__all__ = ["PlanError", "SceneError", "SimMissingError", "ThenarError"]


class SceneError(ThenarError, ValueError):
    """A scene cannot be simulated as it stands: the message names the file, the place in it, and what to do."""


class PlanError(ThenarError, ValueError):
    """No posture of a hand holds an object as a grasp type wants it."""


class SimMissingError(ThenarError, ImportError):
    """An effect needs a package of the extra `sim` that is not installed."""
