"""The classifier of a build in C: the core, which is the same for every build, and the tables of one build; likewise
the decoder of segments and the costs that a build has learnt for it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from textwrap import wrap

from thenar.firmware_templates.rendering import file_text, render
from thenar.runtime.manifest import Manifest
from thenar.runtime.segmenting.model import SegmentModel

from . import FirmwareError
from .layout import Layout, Rows
from .sensors import Sensors, codes_files, sensors_of
from .softmax import Softmax
from .straight import straight
from .words import answers_of, check_name, comment, identifiers, inputs_in_words, joint_in_words, none_of, string

LIBRARY_NAME = "glove"
"""The default name of the library: its files are thenar_glove.h and so on."""
FIRMWARE_NAME = "firmware"
CORE_FILES = ("thenar.h", "thenar_block.h", "thenar.c")
SEGMENT_FILES = ("thenar_segments.h", "thenar_segments.c")
LIBRARY_FILES = (
    *CORE_FILES,
    *SEGMENT_FILES,
    *(f"thenar_{LIBRARY_NAME}{part}{ending}" for part in ("", "_codes", "_segments") for ending in (".h", ".c")),
)
"""The folder of a build that contains the library, and the files that it may contain."""

COLUMNS = 120
_INDENT = "    "

LAG_US = 150_000
_MOST_STATES = 255  # which a byte numbers


@dataclass(frozen=True)
class Library:
    """The classifier for a target's files: the name of its tables, the names in it, and their layout.

    name   of the files, thenar_NAME: one that words.check_name allows
    notes  lines for the opening comment of its header
    glove  the known sensors of a glove; None: only the names are known

    Raises FirmwareError if the name cannot be used in C.
    """

    name: str
    names: Manifest
    layout: Layout
    notes: tuple[str, ...] = ()
    glove: Sensors | None = None

    def __post_init__(self) -> None:
        check_name(self.name)

    @property
    def sensors(self) -> Sensors:
        """The sensors whose readings become codes."""
        return sensors_of(self.names) if self.glove is None else self.glove

    @cached_property
    def files(self) -> dict[str, str]:
        """The classifier alone, name -> text: the core, and the tables thenar_NAME.h and .c."""
        names, layout, tables = self.names, self.layout, self.layout.tables
        texts, prefix = answers_of(names), f"THENAR_{self.name.upper()}"
        switches, joints = [switch.name for switch in names.switches], [joint.name for joint in names.joints]
        rows = _row_lines(layout.start[None], layout, "START")
        for title, inputs, section in layout.sections:
            said = [(switches if title == "switches" else joints)[n] for n in inputs]
            rows += ["", *_remark(f"{title}: {', '.join(map(comment, said))}"), *_row_lines(section, layout, "PAIR")]
        values = {
            "name": self.name,
            "names": names,
            "tables": tables,
            "layout": layout,
            "cells": _cells,
            "notes": [*map(comment, self.notes)],
            "inputs": inputs_in_words(tables.n_switches, tables.n_joints),
            "nothing_held": none_of(names),
            "texts": [string(f"{text}\0") for text in texts[:-1]] + [string(texts[-1])],
            "name_bytes": 1 + max(len(text.encode()) for text in texts),
            "softmax": Softmax(tables.scale),
            "columns": _remark(f"The entries of a row: {', '.join(map(comment, names.grasps))}."),
            "rows": rows,
            "slopes": _row_lines([line.row.astype(int) for line in tables.lines], layout, "SLOPES"),
            "straight": straight(layout),
            "grasp_enum": _enumerators(f"{prefix}_GRASP", names.grasps, names.grasps),
            "switch_enum": _enumerators(f"{prefix}_SWITCH", switches, switches),
            "joint_enum": _enumerators(f"{prefix}_JOINT", joints, map(joint_in_words, names.joints)),
        }
        files = {name: file_text(f"core/{name}") for name in CORE_FILES}
        for ending in (".h", ".c"):
            files[f"thenar_{self.name}{ending}"] = render(f"tables/thenar_NAME{ending}.j2", **values)
        return files

    @cached_property
    def whole(self) -> dict[str, str]:
        """The classifier, what converts readings to codes, and the decoder of segments if the build has one."""
        return self.files | self.codes | self.segments

    @cached_property
    def codes(self) -> dict[str, str]:
        """The files that convert readings to codes."""
        return codes_files(self.name, self.sensors)

    @cached_property
    def segments(self) -> dict[str, str]:
        """The files of the decoder of segments."""
        model = self.names.segments
        return {} if model is None else segment_files(self.name, model)

    @property
    def sources(self) -> list[str]:
        """The names of the files to compile."""
        return [path for path in self.whole if path.endswith(".c")]


def _cells(cells: Iterable[object], suffix: str = "") -> str:
    """Return cells without breaks as lines, each cell followed by `suffix` and a comma."""
    text = " ".join(f"{cell}{suffix}," for cell in cells)
    return "\n".join(_INDENT + line for line in wrap(text, COLUMNS - len(_INDENT), break_on_hyphens=False))


def _row_lines(rows: Iterable[Rows], layout: Layout, macro: str) -> list[str]:
    """Return the lines of rows (m, K): pairs of entries, filled up to those of a row."""
    found = []
    for row in rows:
        entries = row.tolist() + [0] * (2 * layout.row_pairs - len(row))
        pairs = zip(entries[::2], entries[1::2], strict=True)
        found.append(_cells(f"{macro}({low},\xa0{high})" for low, high in pairs).replace("\xa0", " "))
    return found


def _remark(text: str) -> list[str]:
    """Return a comment as indented lines."""
    first, *rest = wrap(text, COLUMNS - 10, break_long_words=True, break_on_hyphens=False)
    lines = [f"{_INDENT}/* {first}", *(f"{_INDENT} * {line}" for line in rest)]
    return [*lines[:-1], lines[-1] + " */"]


def _enumerators(prefix: str, names: Sequence[str], described: Iterable[str]) -> list[str]:
    """Return the lines of enumerators, each with its description; the description comes first if it is too long."""
    lines = []
    for number, (word, what) in enumerate(zip(identifiers(names), map(comment, described), strict=True)):
        line, more = f"{prefix}_{word} = {number},", f" /**< {what} */"
        if len(_INDENT + line + more) <= COLUMNS:
            lines.append(line + more)
        else:
            first, *rest = wrap(what, COLUMNS - 14, break_long_words=True, break_on_hyphens=False)
            lines += [f"/** {first}", *(f" *  {each}" for each in rest)]
            lines[-1] += " */"
            lines.append(line)
    return lines


def segment_files(name: str, model: SegmentModel) -> dict[str, str]:
    """Return the texts of the decoder, and of the costs thenar_`name`_segments.h and .c.

    Raises FirmwareError if there are too many states.
    """
    limit = -(-model.most * 256 // model.gain) << model.shift
    clipped = model.most if limit <= 65535 else min((65535 >> model.shift) * model.gain >> 8, model.most)
    states, rings = _laid_out(model)
    values = {
        "name": name,
        "model": model,
        "lag": lag_of(model),
        "states": states,
        "groups": rings,
        "waiting": rings[-1][1] if rings else 0,
        "limit": min(limit, 65535),
        "clipped": clipped,
    }
    costs = {
        f"thenar_{name}_segments{ending}": render(f"tables/thenar_NAME_segments{ending}.j2", **values)
        for ending in (".h", ".c")
    }
    return {path: file_text(f"core/{path}") for path in SEGMENT_FILES} | costs


def lag_of(model: SegmentModel) -> int:
    """Return the ticks until a tick's state is known. Raises FirmwareError if the decoder cannot number the states."""
    if model.n_types >= _MOST_STATES:
        raise FirmwareError(f"{model.n_types} grasp types: the segment decoder takes at most {_MOST_STATES - 1}")
    return min(max(LAG_US // model.tick_us, 1), 250)


def _laid_out(model: SegmentModel) -> tuple[list[tuple[int, ...]], list[tuple[int, int, int]]]:
    """Return for each state the costs to enter, from none and from another type, to leave, and to stay, its shortest
    duration, its ring and its place in that; and the rings in which states wait until they have lasted long enough, one
    for each shortest duration: begin, end, and the states of a row.
    """
    numbers, rings, end = dict[int, int](), list[tuple[int, int, int]](), 0
    for least in sorted({each for each in model.least if each > 1}, key=model.least.index):
        width, begin = model.least.count(least), end
        end = begin + width * (least - 1)
        numbers[least] = len(rings)
        rings.append((begin, end, width))
    usual = max(model.stay, key=model.stay.count)
    # A change costs what the type says; the state none adds nothing.
    changes = zip((*model.enter, 0), (*model.direct, 0), (*model.leave, 0), strict=True)
    states = list[tuple[int, ...]]()
    for k, (change, stay, least) in enumerate(zip(changes, model.stay, model.least, strict=True)):
        # Only differences between states matter, so the usual cost is subtracted; smaller ones wrap modulo 2^16.
        states.append((*change, (stay - usual) % 65536, least, numbers.get(least, 0), model.least[:k].count(least)))
    return states, rings
