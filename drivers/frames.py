"""Binary frames of a fixed length by a pattern, such as "F0 B10 F7": fixed bytes and numbers, in order.

F0, 0xB5   a fixed byte, in hexadecimal; with 0x if it would be a number by the next line
B10, h     10 numbers of the type B, one of the type h; types as in Python's struct: b, B (8 bits), h, H (16), i, I
           (32), f (32, floating point)
>          in front: numbers with their high byte first; < (low byte first) is the default
"""

import math
import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from struct import Struct
from typing import NamedTuple

from .errors import SettingError
from .lines import LONGEST, LineCounts, Row, finite
from .names import shortened

_TOKEN = re.compile(r"(?P<type>[bBhHiIf])(?P<count>[1-9]\d{0,3})?|(?:0x)?(?P<byte>[0-9A-F]{2})")
_SHOWN = 16
# A guess takes 16 frames at least, and at most so long ones, so much data, and so long runs of fixed bytes; another
# type of numbers must be clearly better.
_FEWEST, _LONGEST, _MOST, _HEADER, _BETTER = 16, 128, 8_192, 4, 0.7
# Bytes with which no frame begins or ends, unless there is nothing else.
_UNUSUAL = bytes(byte for byte in range(128) if byte not in b"\r\nUZ~#$<>{}")
_TYPES = ("B", "H", ">H", "h", ">h", "f", ">f", "i", ">i")


class FrameFormat(NamedTuple):
    """A compiled pattern: where frames are, what their numbers are, and how many."""

    places: re.Pattern[bytes]
    struct: Struct
    numbers: int


def frame_format(pattern: str) -> FrameFormat:
    """Return the format of a pattern. Raises SettingError if it is none."""
    order = pattern[:1] if pattern[:1] in ("<", ">") else "<"
    expression, packed, numbers = b"", order, 0
    for word in pattern.removeprefix(order).split():
        found = _TOKEN.fullmatch(word)
        if found is None:
            said = 'write fixed bytes in hexadecimal and numbers as in "F0 B10 F7"'
            raise SettingError(f"{shortened(repr(word))} is neither a byte nor a type of numbers: {said}")
        count = int(found["count"] or 1)
        part = "x" if found["byte"] else f"{count}{found['type']}"
        numbers += 0 if found["byte"] else count
        packed += part
        fixed = re.escape(bytes.fromhex(found["byte"] or ""))
        expression += fixed or b".{%d}" % Struct(f"<{part}").size
    struct = Struct(packed)
    if "x" not in packed or not numbers or struct.size > LONGEST:
        wanted = f"a fixed byte and a number, at most {LONGEST} bytes in all"
        raise SettingError(f"{shortened(repr(pattern))} needs {wanted}")
    return FrameFormat(re.compile(expression, re.DOTALL), struct, numbers)


class FrameParser:
    """Parses rows from chunks of bytes, as LineParser does; a misfit is a run of bytes in no frame."""

    def __init__(self, pattern: str) -> None:
        self.counts, self.odd, self._format = LineCounts(), "", frame_format(pattern)
        self.begin()

    def begin(self) -> None:
        """Reset: an incomplete frame is forgotten."""
        self._rest, self._lost = b"", False

    def feed(self, chunk: bytes) -> list[Row]:
        """Return the rows whose frames `chunk` completes."""
        data, at, rows = self._rest + chunk, 0, list[Row]()
        for found in self._format.places.finditer(data):
            self._skip(data[at : found.start()])
            self._lost, at = False, found.end()
            rows.append(Row(None, tuple(finite(float(value)) for value in self._format.struct.unpack(found[0]))))
        # A frame may begin in what is shorter than one.
        rest = max(at, len(data) - self._format.struct.size + 1)
        self._skip(data[at:rest])
        self._rest = data[rest:]
        return rows

    def _skip(self, data: bytes) -> None:
        if data and not self._lost:
            self.counts.misfits += 1
            self.odd = f"{data[:_SHOWN].hex(' ').upper()}{'...' if len(data) > _SHOWN else ''}"
            self._lost = True


def guess_frame(chunks: Sequence[bytes]) -> str:
    """Return the pattern of the frames in what a sender sent, all numbers of one type; "" if there is none.

    Bytes that follow on each other and never change are fixed. Of all lengths and types, the numbers are those that
    change least from frame to frame. The first byte is the one with which most chunks begin, or else the greatest.
    """
    data, begins = b"".join(chunks)[-_MOST:], Counter(chunk[0] for chunk in chunks if chunk)
    first = next((byte for byte, count in begins.items() if 2 * count > len(chunks)), None)
    best, least = "", math.inf
    for size in range(2, min(_LONGEST, len(data) // _FEWEST) + 1):
        for before, after in _headers(data[-_FEWEST * size :], size, first):
            expression = re.escape(before) + b".{%d}" % (size - len(before) - len(after)) + re.escape(after)
            frames = re.findall(expression, data, re.DOTALL)
            if 2 * len(frames) * size < len(data):
                continue
            for kind in _TYPES:
                rest, width = size - len(before) - len(after), Struct(f"<{kind[-1]}").size
                rough = math.inf if rest % width else _roughness(frames, len(before), kind, rest // width)
                if rough < _BETTER * least:
                    words = [f"0x{byte:02X}" if 0xB1 <= byte <= 0xB9 else f"{byte:02X}" for byte in before + after]
                    words.insert(len(before), f"{kind[-1]}{rest // width}")
                    best, least = " ".join([*kind[:-1], *words]), rough
    return best


def _headers(window: bytes, size: int, first: int | None) -> list[tuple[bytes, bytes]]:
    """Return the fixed bytes at both ends of a frame, for each run of bytes that are the same in all frames; that with
    the likeliest first byte comes first.
    """
    steady = [len(set(window[place::size])) == 1 for place in range(size)]
    headers = list[tuple[bytes, bytes]]()
    for start in range(size):
        if not steady[start] or steady[start - 1]:
            continue
        length = next(length for length in range(1, size) if not steady[(start + length) % size])
        run = bytes(window[(start + place) % size] for place in range(length))
        for at in range(length):
            # A part of a run may be of numbers: of sensors that did not move, or of their high bytes.
            before, after = run[at : at + 1] + run[at + 1 :].rstrip(_UNUSUAL), run[:at].lstrip(_UNUSUAL)
            whole = [(before, after), (before, b"")] if length <= _HEADER else []
            headers += dict.fromkeys([*whole, (run[at : at + 1], b"")])
    return sorted(headers, key=lambda ends: (ends[0][0] != first, -ends[0][0]))


def _roughness(frames: Sequence[bytes], start: int, kind: str, count: int) -> float:
    """Return the mean square change of numbers from frame to frame, as a share of their range; infinity if there are
    numbers that nothing measures.
    """
    packed = Struct(f"{kind[:-1] or '<'}{count}{kind[-1]}")
    rows = [packed.unpack_from(frame, start) for frame in frames]
    if not all(value == 0 or 1e-4 < abs(value) < 1e10 for row in rows for value in row):
        return math.inf
    columns = [column for column in zip(*rows, strict=True) if min(column) < max(column)]
    steps = (
        sum((later - earlier) ** 2 for earlier, later in pairwise(column)) / (max(column) - min(column)) ** 2
        for column in columns
    )
    return sum(steps) / len(columns) / len(rows) if columns else math.inf
