"""How the classes of a build are divided among passes: an AVR has registers for fourteen sums of 16 bits."""

from dataclasses import dataclass

MOST_CLASSES = 14


@dataclass(frozen=True, slots=True)
class Parts:
    """Every part has `width` classes; part p begins at class firsts[p]. The last two overlap where K is no multiple."""

    width: int
    firsts: tuple[int, ...]


def parts_of(n_classes: int) -> Parts:
    """Return the fewest parts of equal width, at most 14, that cover `n_classes`."""
    count = -(-n_classes // MOST_CLASSES)
    width = -(-n_classes // count)
    return Parts(width, tuple(min(part * width, n_classes - width) for part in range(count)))
