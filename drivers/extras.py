"""Optional packages: the extra of thenar that installs each, and the error where one is missing."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from .errors import ThenarError

# The packages that the extras of pyproject.toml install, by import name.
EXTRAS: Mapping[str, tuple[str, ...]] = {
    "compiler": (
        *("sklearn", "scipy", "joblib", "matplotlib", "threadpoolctl", "jinja2", "clevercsv"),
        *("python_calamine", "pyarrow", "pandas", "h5py", "mcap", "rosbags", "c3d"),
    ),
    "stability": ("mpmath",),
    "ros": ("cyclonedds",),
    "lsl": ("pylsl",),
    "ble": ("bleak",),
    "mqtt": ("paho",),
    "osc": ("pythonosc",),
    "web": ("aiohttp",),
    "foxglove": ("foxglove",),
}


class MissingPackageError(ThenarError, ModuleNotFoundError):
    """An optional package is not installed; the message says which extra of thenar installs it."""


def missing(module: str, prefer: str = "") -> str:
    """Return the sentence that says how to install the package of a module that is missing: by the extra `prefer` if
    that has it, else by the first one that has.
    """
    package = module.partition(".")[0]
    extras = sorted((extra for extra in EXTRAS if package in EXTRAS[extra]), key=lambda extra: extra != prefer)
    return f'{package} is not installed: pip install "{f"thenar[{extras[0]}]" if extras else "thenar"}"'


@contextmanager
def optional(kind: type[ThenarError] = MissingPackageError, place: str = "") -> Iterator[None]:
    """Turn a missing package, while it is imported here, into an error of this kind that says what to install.

    `place` says what needs it.
    """
    try:
        yield
    except ModuleNotFoundError as lack:
        sentence = str(lack) if isinstance(lack, MissingPackageError) else missing(lack.name or "")
        raise kind(f"{place}: {sentence}" if place else sentence) from None
