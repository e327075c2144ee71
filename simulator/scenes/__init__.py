"""The scenes that are shipped: quick.toml is found as "quick"."""

from importlib.resources import files
from importlib.resources.abc import Traversable


def shipped() -> dict[str, Traversable]:
    """Return the files of the shipped scenes by name, in the order of their names."""
    scenes = {
        file.name.removesuffix(".toml"): file for file in files(__package__).iterdir() if file.name.endswith(".toml")
    }
    return dict(sorted(scenes.items()))
