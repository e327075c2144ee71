"""Pages that choose sensors and show errors: they train, so they need the compiler; the live pages are in runtime/web.

`ChoosePage` serves the page on which sensors are clicked on and off.
"""

from .choose import ChoosePage

__all__ = ["ChoosePage"]
