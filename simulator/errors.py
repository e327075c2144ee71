"""Errors of scenes and their simulation."""

from thenar.drivers.errors import ThenarError

__all__ = ["SceneError", "ThenarError"]


class SceneError(ThenarError, ValueError):
    """A scene cannot be simulated, or no posture of a hand holds an object with a grasp type.

    The message says where, and what to do.
    """
