"""Pages of one file: their templates, the data in their scripts, and the hashes that their policy allows."""

import base64
import hashlib

import msgspec

from thenar.drivers.extras import optional

with optional():
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup


def templates(package: str, folder: str) -> Environment:
    """Return the environment of the templates in a package's folder."""
    return Environment(
        loader=PackageLoader(package, folder),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def embedded(data: object) -> Markup:
    """Return JSON for a script element: whatever a name contains, it begins or ends no tag and is no entity."""
    text = msgspec.json.encode(data).decode()
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return Markup(text)


def policy_hash(text: str) -> str:
    """Return the SHA-256 by which a page's policy allows a script or a style."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
