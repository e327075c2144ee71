"""The targets of firmware: a file for each target, or for a family of them, and their registry."""

from thenar.drivers.members import Members

from .base import Target

__all__ = ["TARGETS", "Target", "kinds", "timed"]

TARGETS: Members[Target] = Members("firmware target", Target, __name__, "thenar.targets")


def kinds() -> tuple[str, ...]:
    """Return the names of the kinds whose code can be run: those of `thenar verify --firmware`."""
    return tuple(dict.fromkeys(target.kind for target in TARGETS.values() if target.kind))


def timed() -> tuple[str, ...]:
    """Return the names that a Pareto front can be timed for: parts with a clock, and hosts that classify in Python."""
    return (*(name for name, target in TARGETS.items() if target.clock_hz is not None), "host", "pi")
