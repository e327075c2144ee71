"""The classifier of a build in C: the core, which is the same for every build, and the tables of one build; likewise
the decoder of segments and the costs that a build has learnt for it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from textwrap import wrap
from typing import Any

from thenar.firmware_templates.rendering import file_text, render
from thenar.runtime.manifest import Manifest, Rejection
from thenar.runtime.model.terms.line import Slope
from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.softmax import Softmax

from . import FirmwareError
from .layout import Layout, Rows, StoredBins
from .sensors import Sensors, codes_files, sensors_of
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
_NO_CHANGE = {"enter": 0, "direct": 0, "leave": 0}


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
        files = {name: file_text(f"core/{name}") for name in CORE_FILES}
        values = _values(self.name, self.names, self.layout, self.notes)
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


def _lines(cells: Iterable[object]) -> list[str]:
    """Return cells without breaks as lines, separated by commas."""
    text = ", ".join(map(str, cells))
    width = COLUMNS - len(_INDENT)
    return [_INDENT + line for line in wrap(f"{text},", width, break_on_hyphens=False)] if text else []


def _values(name: str, names: Manifest, layout: Layout, notes: Sequence[str]) -> dict[str, object]:
    """Return the values for the templates of the tables."""
    tables, texts = layout.tables, answers_of(names)
    own, pairs = layout.bins[: len(layout.binned)], layout.bins[len(layout.binned) :]
    return {
        "name": name,
        "upper": name.upper(),
        "notes": [*map(comment, notes)],
        "digest": names.tables_sha256[:16],
        "inputs": inputs_in_words(tables.n_switches, tables.n_joints),
        "classes": tables.n_classes,
        "switches": tables.n_switches,
        "joints": tables.n_joints,
        "nothing_held": none_of(names),
        "names": [string(f"{text}\0") for text in texts[:-1]] + [string(texts[-1])],
        "name_bytes": 1 + max(len(text.encode()) for text in texts),
        "memory": layout.memory,
        "row_pairs": layout.row_pairs,
        "group": layout.group,
        "found": layout.found,
        "softmax": Softmax(tables.scale),
        "columns": _remark(f"The entries of a row: {', '.join(map(comment, names.grasps))}."),
        "rows": [*_row_lines(layout.start[None], layout, "START"), *_section_lines(names, layout)],
        "slopes": _row_lines([line.row.astype(int) for line in tables.slopes], layout, "SLOPES"),
        "lines": [f"{_INDENT}{_line(line)}," for line in tables.slopes],
        "bins": [f"{_INDENT}{_bins(each)}," for each in own],
        "n_bins": len(own),
        "grids": [f"{_INDENT}{_grid(*pair)}," for pair in zip(pairs[::2], pairs[1::2], strict=True)],
        "thresholds": _lines(f"{step}u" for step in layout.thresholds),
        "means": [line for row in layout.means.astype("int16").tolist() for line in _lines(row)],
        "rejection": _rejection(names.rejection),
        "straight": straight(layout),
        **_enumerations(name, names),
    }


def _bins(bins: StoredBins) -> str:
    return f"{{{bins.joint}u, {bins.first_threshold}u, {bins.half}u, {bins.first_row}u}}"


def _grid(down: StoredBins, across: StoredBins) -> str:
    return f"{{{len(across.thresholds) + 1}u, {_bins(down)}, {_bins(across)}}}"


def _line(line: Slope) -> str:
    left, right = max(line.gain, 0), max(-line.gain, 0)
    return f"{{{line.joint}u, {line.low}u, {line.high - line.low}u, {left}u, {right}u}}"


def _section_lines(names: Manifest, layout: Layout) -> Iterable[str]:
    for title, inputs, rows in layout.sections:
        said = [names.switches[n].name if title == "switches" else names.joints[n].name for n in inputs]
        yield from ["", *_remark(f"{title}: {', '.join(map(comment, said))}")]
        yield from _row_lines(rows, layout, "PAIR")


def _row_lines(rows: Iterable[Rows], layout: Layout, macro: str) -> list[str]:
    """Return the lines of rows (m, K): pairs of entries, filled up to those of a row."""
    found = []
    for row in rows:
        entries = row.tolist() + [0] * (2 * layout.row_pairs - len(row))
        found += _lines(f"{macro}({low},\xa0{high})" for low, high in zip(entries[::2], entries[1::2], strict=True))
    return [line.replace("\xa0", " ") for line in found]


def _remark(text: str) -> list[str]:
    """Return a comment as indented lines."""
    first, *rest = wrap(text, COLUMNS - 10, break_long_words=True, break_on_hyphens=False)
    lines = [f"{_INDENT}/* {first}", *(f"{_INDENT} * {line}" for line in rest)]
    return [*lines[:-1], lines[-1] + " */"]


def _rejection(rejection: Rejection | None) -> dict[str, object] | None:
    if rejection is None:
        return None
    return {
        "least_scores": _lines(rejection.least_scores),
        "closed": _lines(f"{count}u" for count in chain(*rejection.closed)),
        "ranges": _lines(f"{code}u" for code in chain(*chain(*rejection.ranges))),
        "outside": rejection.outside,
    }


def _enumerations(name: str, names: Manifest) -> dict[str, list[str]]:
    """Return the lines of the enumerations in the header."""
    kinds = {
        "grasp": [(grasp, comment(grasp)) for grasp in names.grasps],
        "switch": [(switch.name, comment(switch.name)) for switch in names.switches],
        "joint": [(joint.name, comment(joint_in_words(joint))) for joint in names.joints],
    }
    return {f"{kind}_enum": _enumerators(f"THENAR_{name}_{kind}".upper(), each) for kind, each in kinds.items()}


def _enumerators(prefix: str, named: Sequence[tuple[str, str]]) -> list[str]:
    """Return the lines of enumerators, each with its description; the description comes first if it is too long."""
    lines = []
    for number, (word, (_, what)) in enumerate(zip(identifiers([own for own, _ in named]), named, strict=True)):
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
    values = decoder_values(model)
    limit = -(-model.most * 256 // model.gain) << model.shift
    clipped = model.most if limit <= 65535 else min((65535 >> model.shift) * model.gain >> 8, model.most)
    values |= {
        "name": name,
        "upper": name.upper(),
        "limit": min(limit, 65535),
        "clipped": clipped,
        "one_leave": len(set(model.leave)) == 1,
    }
    costs = {
        f"thenar_{name}_segments{ending}": render(f"tables/thenar_NAME_segments{ending}.j2", **values)
        for ending in (".h", ".c")
    }
    return {path: file_text(f"core/{path}") for path in SEGMENT_FILES} | costs


def decoder_values(model: SegmentModel) -> dict[str, Any]:
    """Return the values for a template of the decoder in any language. Raises FirmwareError for too many states."""
    if model.n_types >= _MOST_STATES:
        raise FirmwareError(f"{model.n_types} grasp types: the segment decoder takes at most {_MOST_STATES - 1}")
    states, rings = _laid_out(model)
    return {
        "model": model,
        "types": model.n_types,
        "refusal": model.refusal,
        "lag": lag_of(model),
        "states": states,
        "groups": rings,
        "waiting": rings[-1]["end"] if rings else 0,
        "mask_bytes": -(-len(states) // 8),
    }


def lag_of(model: SegmentModel) -> int:
    """Return the ticks until a tick's state is known."""
    return min(max(LAG_US // model.tick_us, 1), 250)


def _laid_out(model: SegmentModel) -> tuple[list[dict[str, int]], list[dict[str, int]]]:
    """Return the costs of each state, and its ring and place in it; and the rings in which states wait until they have
    lasted long enough, one for each shortest duration: from `begin` to `end`, `width` a row.
    """
    numbers: dict[int, int] = {}
    rings: list[dict[str, int]] = []
    end, K = 0, model.n_types
    for least in sorted({each for each in model.least if each > 1}, key=model.least.index):
        width, begin = model.least.count(least), end
        end = begin + width * (least - 1)
        numbers[least] = len(rings)
        rings.append({"begin": begin, "end": end, "width": width})
    usual = max(model.stay, key=model.stay.count)
    states = []
    for k, least in enumerate(model.least):
        change = {"enter": model.enter[k], "direct": model.direct[k], "leave": model.leave[k]} if k < K else _NO_CHANGE
        # Only differences between states matter, so the usual cost is subtracted; smaller ones wrap modulo 2^16.
        stay = (model.stay[k] - usual) % 65536
        place = {"ring": numbers.get(least, 0), "place": model.least[:k].count(least)}
        states.append({**change, "stay": stay, "least": least, **place})
    return states, rings
