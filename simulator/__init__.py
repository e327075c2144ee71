"""Simulated scenes: grasps, hands and faults, only as far as a scene requires.

The names below are loaded on first use: drawing a glove needs no simulation.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from thenar.drivers.extras import optional

if TYPE_CHECKING:
    from .pipeline.scene_file import load_scene
    from .pipeline.simulation import Simulation, simulate

__all__ = ["Simulation", "load_scene", "simulate"]

_HOMES = {
    "Simulation": ".pipeline.simulation",
    "load_scene": ".pipeline.scene_file",
    "simulate": ".pipeline.simulation",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with optional():
        return getattr(import_module(_HOMES[name], __name__), name)
