"""A template of C and values in, text out."""

from functools import lru_cache

from jinja2 import Environment, PackageLoader, StrictUndefined


@lru_cache(maxsize=1)
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader(__package__, "."),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C and make know no HTML
    )


def render(template: str, **values: object) -> str:
    """Return the text of the template `template`, a path below this package that ends in ".j2".

    Raises jinja2's UndefinedError where the template asks for a value that is not given.
    """
    return _environment().get_template(template).render(**values)
