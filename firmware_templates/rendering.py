"""Rendering of a template with values to text."""

from functools import lru_cache
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


@lru_cache(maxsize=1)
def _environment() -> "Environment":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(__package__, "."),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # neither C nor make is HTML
        auto_reload=False,
    )
    environment.globals["thenar_version"] = version("thenar")  # the lookup takes half a millisecond
    return environment


def render(template: str, **values: object) -> str:
    """Return the text of the template `template`, a path below this package that ends in ".j2".

    Templates may use `origin`, a line that names the version and the template. Raises jinja2's UndefinedError if a
    template uses a value that is not given.
    """
    environment = _environment()
    origin = f"thenar {environment.globals['thenar_version']}, template {template}."
    return environment.get_template(template).render(origin=origin, **values)


def file_text(path: str) -> str:
    """Return the text of a file below this package that is no template, such as "core/thenar.c"."""
    return files(__package__).joinpath(path).read_text()
