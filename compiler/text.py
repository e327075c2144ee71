"""Formatting of numbers in reports, pictures, tables and sentences; and of text cells that are no formulas."""

import re
from collections.abc import Iterable, Sequence

DASH = "–"
NBSP = "\N{NO-BREAK SPACE}"


def percent(share: float, space: str = " ") -> str:
    """Return "96.3 %" for 0.963."""
    return f"{100 * share:.1f}{space}%"


def microseconds(us: float) -> str:
    """Return a number of microseconds for a column of them: "48.1", "1,736"."""
    return f"{us:.1f}" if us < 100 else f"{us:,.0f}"


def duration(us: float) -> str:
    """Return a time to three digits, in a suitable unit: "440 µs", "2.05 ms", "1.5 s"."""
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if us >= 0.9995 * size:
            return f"{us / size:.3g} {unit}"
    return f"{us:.3g} µs"


def counted(number: int, one: str, many: str = "") -> str:
    """Return "1 node" or "2 nodes"; `many` is the plural if it is not `one` with an s."""
    return f"{number:,} {one if number == 1 else many or one + 's'}"


def listed(parts: Sequence[str]) -> str:
    """Return "a, b and c"."""
    return ", ".join(parts[:-1]) + (" and " if len(parts) > 1 else "") + "".join(parts[-1:])


INDEPENDENT = "each row counts as a trial: whoever recorded them states that they are independent"


def inputs_read(switches: int, taxels: int, joints: int) -> str:
    """Return "switches 160, joints 18", and the number of taxels if there are any."""
    return f"switches {switches}, {f'taxels {taxels}, ' if taxels else ''}joints {joints}"


def trials_of_frames(frames: int, trials: int, rests: int = 0) -> str:
    """Return "360 trials (180 grasps, 180 rests) of 2,880 frames"; in a rest, nothing is held."""
    kinds = f" ({counted(trials - rests, 'grasp')}, {counted(rests, 'rest')})" if rests else ""
    return f"{counted(trials, 'trial')}{kinds} of {counted(frames, 'frame')}"


def sentence(words: str) -> str:
    """Return words from within a sentence as a whole sentence."""
    return f"{words[:1].upper()}{words[1:].removesuffix('.')}."


# Text that a spreadsheet would compute, after any number of apostrophes: so text and cell map one to one.
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def cell(text: str) -> str:
    """Return `text`, with an apostrophe in front if a spreadsheet would take it for a formula."""
    return f"'{text}" if _FORMULA.match(text) else text


def cells(row: Iterable[object]) -> list[object]:
    """Return `row` with each text as a cell; numbers stay as they are."""
    return [cell(value) if isinstance(value, str) else value for value in row]


def text_of(cell: str) -> str:
    """Return the text of a `cell`."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell
