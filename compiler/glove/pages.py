"""Sheets of paper: the smallest that holds a drawing, and how many of A4 do."""

from dataclasses import dataclass

# What most printers leave white at an edge.
MARGIN_MM = 5.0
_A4_MM = (210.0, 297.0)
_SHEETS = (("A4", *_A4_MM), ("A3", 297.0, 420.0), ("A2", 420.0, 594.0), ("A1", 594.0, 841.0), ("A0", 841.0, 1189.0))


@dataclass(frozen=True, slots=True)
class Page:
    """A sheet; `name` is empty where no common one is large enough."""

    name: str
    width_mm: float
    height_mm: float

    @property
    def hint(self) -> str:
        """What to print it on, in words."""
        if self.name == "A4":
            return "one A4 sheet"
        across, down = (_tiles(self.width_mm, _A4_MM[0]), _tiles(self.height_mm, _A4_MM[1]))
        size = f"{self.name or 'a sheet'} ({self.width_mm:g} x {self.height_mm:g} mm)"
        return f"{size}, or {across * down} A4 sheets, {across} across and {down} down, as a poster without scaling"


def page_for(width_mm: float, height_mm: float) -> Page:
    """Return the smallest sheet that holds a drawing of this size, and a margin around it, upright or lying."""
    wide, high = width_mm + 2 * MARGIN_MM, height_mm + 2 * MARGIN_MM
    for name, short, long in _SHEETS:
        for across, up in ((short, long), (long, short)):
            if wide <= across and high <= up:
                return Page(name, across, up)
    return Page("", wide, high)


def _tiles(length_mm: float, sheet_mm: float) -> int:
    return int(-(-length_mm // (sheet_mm - 2 * MARGIN_MM)))
