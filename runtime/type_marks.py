"""A short code and a colour for each grasp type, by which pages and pictures distinguish types."""

import re
from collections.abc import Iterable, Iterator
from hashlib import sha256
from itertools import count

from .published import NONE

_HUES, _LIGHTNESS = 12, (0.62, 0.52)  # both have a contrast of 3 : 1 on light and on dark pages
_SLOTS, _STEP = _HUES * len(_LIGHTNESS), 7
_LONGEST = 4  # letters of a code


def type_marks(names: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Return the code and the colour of each type: at most four letters, unique here, and a colour of CSS.

    Both depend on the name alone, unless another of these names has the same: then the later one in the alphabet gets
    the next. Up to 24 types have different colours.
    """
    marks: dict[str, tuple[str, str]] = {}
    codes: set[str] = set()
    slots: set[int] = set()
    wanted = list(names)
    for name in sorted({*wanted} - {NONE}):
        code = next(code for code in _codes(name) if code not in codes)
        slot = int(sha256(name.encode(errors="surrogatepass")).hexdigest()[:8], 16) % _SLOTS
        while slot in slots and len(slots) < _SLOTS:
            slot = (slot + _STEP) % _SLOTS
        codes.add(code)
        slots.add(slot)
        hue, lightness = 360 // _HUES * (slot % _HUES), _LIGHTNESS[slot // _HUES]
        marks[name] = code, f"oklch({lightness} 0.14 {hue})"
    return {name: marks.get(name, (NONE, f"oklch({_LIGHTNESS[0]} 0 0)")) for name in wanted}


def _codes(name: str) -> Iterator[str]:
    """Yield codes for a name, the best first: a short name, initials of words, first letters, and then numbers."""
    words = re.findall(r"[^\W_]+", name) or ["?"]
    letters, initials = "".join(words), "".join(word[0] for word in words).upper()[:_LONGEST]
    if len(name) <= _LONGEST and letters == name:
        yield name
    if len(words) > 1:
        yield initials
    yield from (letters[:size].capitalize()[:_LONGEST] for size in range(2, _LONGEST + 1))
    yield from (f"{initials[:2]}{number}" for number in count(2))
