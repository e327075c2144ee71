"""A table of texts."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PlainTable:
    """A table whose first column heads its rows; every row is as long as `columns`."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
