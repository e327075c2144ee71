"""What the classifier in portable C is made of: two sums of 16 bits side by side in a word of 32.

Two 16-bit entries are one integer, low + 65536 high, so words add up to the word of the sums, whatever was borrowed on
the way. Of four 8-bit entries a, b, c, d the even and the odd ones are added up apart, each with 16 bits of room: no
sum of them is above 65535, for it is the difference of two scores. The odd ones are not masked: (b, c, d) is 256 c more
than b + 65536 d, and the sum of all c, the upper half of the even sum, is subtracted once, in the end.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .layout import Layout, Lookup, Parts, lookups

_STARTS_PER_LINE = 4


def portable_values(name: str, layout: Layout) -> dict[str, object]:
    """Return what the templates of the portable C ask for."""
    narrow, parts = layout.entry_bits == 8, layout.parts
    lanes = _lanes(parts.width, narrow)
    starts, open_sums = (_start_lines(_in_parts(scores, parts), lanes) for scores in (layout.start, layout.all_open))
    n_lanes = max(lane for lane, _ in lanes) + 1
    adding, replacing = _arithmetic(n_lanes, narrow)
    return {
        "words": -(-parts.width // (4 if narrow else 2)),
        "lanes": n_lanes,
        "takes": _takes(lanes, len(parts.firsts) > 1),
        "word_macros": _narrow_macros(parts.width) if narrow else _wide_macros(parts.width),
        "start": starts,
        "open_sums": open_sums,
        "open_rows": [f"&thenar_{name}_rows[{lookup.first_row}]," for lookup in lookups(layout)],
        "finds": [_find(name, layout, lookup) for lookup in lookups(layout)],
        "adding": adding,
        "storing": _storing(n_lanes, narrow),
        "replacing": replacing,
    }


def avr_macros(width: int, entry_bits: int) -> list[str]:
    """Return definitions of the same macros for a table of plain entries, one after the other."""
    at_once, macro = (4, "QUAD(a, b, c, d) (a), (b), (c), (d)") if entry_bits == 8 else (2, "PAIR(a, b) (a), (b)")
    rest = width % at_once
    whole = [macro] if width >= at_once else []
    return whole + [["", "REST(a) (a)", "REST(a, b) (a), (b)", "REST(a, b, c) (a), (b), (c)"][rest]][: bool(rest)]


def _lanes(width: int, narrow: bool) -> list[tuple[int, str]]:
    """Return for every class of a part the number of its word of sums, and which half of it is its sum."""
    if narrow:
        return [(2 * (k // 4) + k % 2, "high" if k % 4 >= 2 else "low") for k in range(width)]
    return [(k // 2, "high" if k % 2 else "low") for k in range(width)]


def _wide_macros(width: int) -> list[str]:
    pair = "PAIR(a, b) ((uint32_t)(int32_t)(a) + ((uint32_t)(int32_t)(b) << 16))"
    return [pair] + (["REST(a) PAIR(a, 0)"] if width % 2 else [])


def _narrow_macros(width: int) -> list[str]:
    quad = "QUAD(a, b, c, d) ((uint32_t)(a) | ((uint32_t)(b) << 8) | ((uint32_t)(c) << 16) | ((uint32_t)(d) << 24))"
    rests = ["REST(a) QUAD(a, 0, 0, 0)", "REST(a, b) QUAD(a, b, 0, 0)", "REST(a, b, c) QUAD(a, b, c, 0)"]
    return [quad, "EVEN(word) ((word) & 0x00FF00FFu)", "ODD(word) (((word) >> 8) & 0x00FF00FFu)"] + (
        [rests[width % 4 - 1]] if width % 4 else []
    )


def _in_parts(scores: NDArray[np.int64], parts: Parts) -> list[list[int]]:
    return [scores[first : first + parts.width].tolist() for first in parts.firsts]


def _start_lines(starts: Sequence[Sequence[int]], lanes: Sequence[tuple[int, str]]) -> list[str]:
    """Return the lines of the initialiser of the sums, in braces for each part where there are several."""
    lines = []
    for start in starts:
        sums: dict[int, list[int]] = {}
        for (lane, _), value in zip(lanes, start, strict=True):
            sums.setdefault(lane, []).append(value)
        words = [f"START({', '.join(map(str, (sums[lane] + [0])[:2]))})" for lane in sorted(sums)]
        held = [", ".join(words[at : at + _STARTS_PER_LINE]) for at in range(0, len(words), _STARTS_PER_LINE)]
        text = [f"{line}," for line in held]
        lines += text if len(starts) == 1 else ["{", *(f"    {line}" for line in text), "},"]
    return lines


def _takes(lanes: Sequence[tuple[int, str]], several: bool) -> list[str]:
    """Return the arguments that say the sum and the number of each class of a part."""
    words, halves = "sum" if several else "sums", {"low": "& 0xFFFFu", "high": ">> 16"}
    numbers = (f"first + {k}u" if several and k else "first" if several else f"{k}u" for k in range(len(lanes)))
    return [f"{words}[{lane}] {halves[half]}, {k}" for (lane, half), k in zip(lanes, numbers, strict=True)]


def _arithmetic(lanes: int, narrow: bool) -> tuple[list[str], list[str]]:
    """Return the statements that add a row to the sums s0, s1..., and those that replace one in sum[]."""
    adding, replacing = [], []
    for lane in range(lanes):
        row, before, after = (f"{each}[{lane // 2 if narrow else lane}]" for each in ("row", "before", "after"))
        if narrow:
            macro = "ODD" if lane % 2 else "EVEN"
            row = f"{row} >> 8" if lane % 2 else f"EVEN({row})"
            before, after = f"{macro}({before})", f"{macro}({after})"
        adding.append(f"s{lane} += {row};")
        replacing.append(f"sum[{lane}] += {after} - {before};")
    return adding, replacing


def _storing(lanes: int, narrow: bool) -> list[str]:
    """Return the statements that put the sums s0, s1..., in words of two, into sum[]."""
    if not narrow:
        return [f"sum[{lane}] = s{lane};" for lane in range(lanes)]
    sums = (f"s{lane} - ((s{lane - 1} >> 16) << 8)" if lane % 2 else f"s{lane}" for lane in range(lanes))
    return [f"sum[{lane}] = from[{lane}] + {text};" for lane, text in enumerate(sums)]


def _find(name: str, layout: Layout, lookup: Lookup) -> str:
    """Return the statement that finds the row of one look-up."""
    source = f"thenar_{name}_input."
    if lookup.joint is None:
        found = f"{source}switches[{lookup.number}]"
    else:
        code, joint = f"{source}codes[{lookup.number}]", lookup.joint
        if layout.bins == "search":
            found = f"below({lookup.first_bin}u, {len(joint.thresholds)}u, {code})"
        else:
            last = len(joint.bins) - 1
            place = code if layout.bins == "direct" else f"clamped({code}, {joint.first}u, {last}u)"
            found = f"thenar_{name}_bins[{_after(lookup.first_bin, place)}]"
    return f"row[{lookup.index}] = &thenar_{name}_rows[{_after(lookup.first_row, found)}];"


def _after(first: int, place: str) -> str:
    return f"{first}u + {place}" if first else place
