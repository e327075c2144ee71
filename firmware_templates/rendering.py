"""A template of C and values in, text out."""

from functools import lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


@lru_cache(maxsize=1)
def _environment() -> "Environment":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader(__package__, "."),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C and make know no HTML
        auto_reload=False,
    )


@lru_cache(maxsize=1)
def _version() -> str:
    """Return our version, which takes half a millisecond to find."""
    return version("thenar")


def render(template: str, **values: object) -> str:
    """Return the text of the template `template`, a path below this package that ends in ".j2".

    A template may say where its text is from: `origin`. Raises jinja2's UndefinedError where it asks for a value that
    is not given.
    """
    origin = f"thenar {_version()}, template {template}."
    return _environment().get_template(template).render(origin=origin, **values)
