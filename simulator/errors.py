"""Errors of scenes and their simulation."""

from thenar.drivers.errors import ThenarError

__all__ = ["PlanError", "SceneError", "ThenarError"]


class SceneError(ThenarError, ValueError):
    """A scene cannot be simulated: the message names the file, the location in it, and the remedy."""


class PlanError(ThenarError, ValueError):
    """No posture of a hand can hold an object with a grasp type."""
