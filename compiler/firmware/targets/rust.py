"""Rust: the classifier as a pure Rust crate, `no_std` and without `unsafe`, from the tables and layout of the C.

A wrapper of the C would need a C compiler for the project's core, a build script and bindings; this crate needs none.
Its scores are compared with Python's in the same way as those of the C.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

from ..tools import RUST, call, find, lacking, workshop
from .base import Target

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from thenar.runtime.segmenting.model import SegmentModel
    from thenar.runtime.tables import Slope

    from ..classifier import Library
    from ..layout import Field, JointLayout, Layout
    from ..probes import Frames, Lost, Predictions

_MOST_COMPARED = 8
_HIGHEST = 65535
_CHECK_TICKS = 20  # of each frame, in the self test of the decoder of segments
_SEGMENTS = "src/segments.rs"


@dataclass(frozen=True, kw_only=True)
class Rust(Target):
    """Any core that Rust compiles for."""

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text of the crate and its self test."""
        from thenar.firmware_templates.rendering import render

        from ..probes import self_test_frames

        frames, layout = self_test_frames(library.layout), library.layout
        scores = layout.scores(frames.bits, frames.codes)
        rows = zip(frames.bits, frames.codes, scores.argmax(axis=1), scores, strict=True)
        checks = [(_array(bits), _array(codes), int(grasp), _array(own)) for bits, codes, grasp, own in rows]
        states, ticks = _stream(library, scores), _CHECK_TICKS
        values = {"name": library.name, "switches": len(library.names.switches), "checks": checks}
        test = render("rust/self_test.rs.j2", **values, states=states, ticks=ticks)
        return {**self.sources(library), "tests/self_test.rs": test}

    def sources(self, library: "Library") -> dict[str, str]:
        """Return path -> text of the crate."""
        from thenar.firmware_templates.rendering import render
        from thenar.runtime.softmax import POWERS, Softmax

        from ..segments import times_of
        from ..words import comment, identifiers, inputs_in_words

        names, layout, rejection = library.names, library.layout, library.names.rejection
        sentence = f"Recognises {len(names.grasps)} grasp types from "
        sentence += f"{inputs_in_words(len(names.switches), len(names.joints))} of a glove."
        kinds = {
            ("The grasp types", "Grasp"): names.grasps,
            ("The switches", "Switch"): tuple(switch.name for switch in names.switches),
            ("The joints", "Joint"): tuple(joint.name for joint in names.joints),
            ("The sensors that are read", "Sensor"): tuple(sensor.name for sensor in library.sensors.every),
        }
        enums = [
            (
                what,
                kind,
                [*zip(_variants(kind, identifiers(texts)), map(comment, texts), map(_string, texts), strict=True)],
            )
            for (what, kind), texts in kinds.items()
        ]
        tables = layout.tables
        values = {
            "name": library.name,
            "sentence": sentence,
            "origin_line": f"From the tables {names.tables_sha256[:16]}; thenar {names.thenar}.",
            "enums": enums,
            "classes": tables.n_classes,
            "switches": tables.n_switches,
            "joints": tables.n_joints,
            "ports": len(layout.ports),
            "code": f"u{layout.code_bits}",
            "softmax": Softmax(tables.scale),
            "powers": _array(POWERS),
            "lookups": len(layout.lookups),
            "start": _words(layout.start + (1 << 15)),
            "rows": [_words(row) for each in layout.lookups for row in each.rows.astype(int) << layout.entry_shift],
            "means": [_words(row) for row in layout.means],
            "places": _array(f"({port}, {1 << bit})" for port, bit in layout.places),
            "slopes": [_words(slope.row.astype(int)) for slope in tables.slopes],
            "distances": [_distance(slope) for slope in tables.slopes],
            "joint_bins": [(joint.number, joint.bins.tolist()) for joint in layout.joints if not joint.compared],
            "finds": _finds(layout),
            "rejection": rejection,
            "segments": names.segments is not None,
            **({} if names.segments is None else times_of(names.segments)),
            **_sensor_values(library),
        }
        if rejection is not None:
            values["least_scores"] = _array(rejection.least_scores)
            values["closed"] = _array(rejection.closed)
            values["ranges"] = [_array(own) for own in rejection.ranges]
        made = {"Cargo.toml": "Cargo.toml", "lib.rs": "src/lib.rs", "tables.rs": "src/tables.rs"}
        files = {path: render(f"rust/{of}.j2", **values) for of, path in made.items()}
        if names.segments is not None:
            files[_SEGMENTS] = render("rust/segments.rs.j2", **_segment_values(names.segments))
        return files

    def missing(self) -> str | None:
        """Return which of cargo and rustc is missing, and how to install it; None if neither is."""
        return lacking(RUST)

    def run(
        self,
        files: Mapping[str, str],
        name: str,
        layout: "Layout",
        frames: "Frames",
        *,
        incremental: bool = False,
        lost: "Lost | None" = None,
    ) -> "Predictions":
        """Return the crate's predictions for frames (n, F) on this machine, as in the base class; overflows fail."""
        from thenar.firmware_templates.rendering import render

        from ..probes import answers_in, check_frames, record_values, with_lost

        check_frames(frames, layout)
        values = record_values(name, layout, "update" if incremental else "classify", lost=lost is not None)
        has = {"rejection": "fn held(" in files["src/lib.rs"], "segments": _SEGMENTS in files}
        main = render("checking/record.rs.j2", **values, **has)
        given: dict[str, str | bytes] = {
            **files,
            "examples/record.rs": main,
            "frames": with_lost(frames, lost).tobytes(),
        }
        with workshop(given) as folder:
            call([find(RUST), "run", "--quiet", "--offline", "--example", "record"], folder)
            return answers_in((folder / "predictions").read_bytes(), frames, layout)


def _sensor_values(library: "Library") -> dict[str, object]:
    """Return the templates' values for the sensors."""
    from thenar.runtime.code_line import FARTHEST, FRACTION

    sensors, joints = library.sensors, len(library.names.joints)
    grids = [
        (0, 0, 0, 0) if (grid := sensor.grid) is None else (grid.low, grid.high, grid.first, grid.steps)
        for sensor in sensors.every
    ]
    return {
        "sensors": len(sensors.every),
        "points": _array(sensor.codes for sensor in sensors.every),
        "readings": _array(sensor.readings or (0, 0) for sensor in sensors.every),
        "grids": _array(grids) if any(low != high for low, high, *_ in grids) else "",
        "levels": sensors.levels,
        "level_array": _array((number, joints + taxel, above) for number, taxel, above in sensors.levels),
        "fraction": FRACTION,
        "farthest": FARTHEST,
    }


def _stream(library: "Library", scores: "NDArray[np.int64]") -> str:
    """Return the states of a stream that holds the frame of each of the scores for some ticks, of which every fifth is
    refused; "" for a build without costs of segments.
    """
    from thenar.runtime.segmenting.decoder import Decoder

    from ..segments import lag_of

    if (model := library.names.segments) is None:
        return ""
    decoder = Decoder(model, lag_of(model))
    pushed = (decoder.push(own, refused=tick % 5 == 0).state for own in scores.tolist() for tick in range(_CHECK_TICKS))
    return "[" + ", ".join("None" if state == model.n_types else f"Some({state})" for state in pushed) + "]"


def _segment_values(model: "SegmentModel") -> dict[str, object]:
    """Return the template's values for the decoder of segments."""
    from ..segments import decoder_values

    waits = [*accumulate((least - 1 for least in model.least), initial=0)]
    return {**decoder_values(model), "waits": waits}


def _variants(kind: str, words: Iterable[str]) -> list[str]:
    """Return variant names for identifiers in capitals: INDEX_TIP becomes IndexTip."""
    plain = ["".join(part.capitalize() for part in word.split("_")) for word in words]
    found: list[str] = []
    for number, word in enumerate(plain):
        word = word if word[:1].isalpha() and word != "Self" else f"{kind}{word}"
        found.append(f"{word}{number}" if plain.count(word) > 1 or word in found else word)
    return found


def _string(text: str) -> str:
    """Return the Rust literal of `text`."""
    return '"' + "".join(c if " " <= c <= "~" and c not in '"\\' else f"\\u{{{ord(c):x}}}" for c in text) + '"'


def _array(values: "Iterable[object]") -> str:
    return "[" + ", ".join(str(value).lower() for value in values) + "]"


def _words(values: "NDArray[np.integer]") -> str:
    """Return numbers (K,) as words of two: low + 65536 high."""
    low, high = values[::2].astype(int), values[1::2].astype(int)
    words = low.copy()
    words[: len(high)] += high << 16
    return _array(f"0x{word & 0xFFFFFFFF:x}" for word in words.tolist())


def _finds(layout: "Layout") -> list[str]:
    """Return the expression for the number of each lookup's row."""
    found, table = [], 0
    for lookup in layout.lookups:
        terms = [str(lookup.first_row)] if lookup.first_row else []
        if lookup.group is not None:
            terms.append("(" + " | ".join(map(_field, layout.fields[lookup.group])) + ")")
        for joint in lookup.joints:
            terms.append(_joint(joint, layout, table))
            table += not joint.compared
        found.append(" + ".join(terms))
    return found


def _field(field: "Field") -> str:
    by, mask = field.bit - field.to, ((1 << field.width) - 1) << field.to
    moved = f" {'>>' if by > 0 else '<<'} {abs(by)}" if by else ""
    return f"(u16::from(ports[{field.port}]){moved}) & 0x{mask:x}"


def _joint(joint: "JointLayout", layout: "Layout", table: int) -> str:
    code, steps = f"codes[{joint.number}]", joint.thresholds.tolist()
    if joint.compared:
        if len(steps) <= _MOST_COMPARED:
            counted = " + ".join(f"u16::from({code} <= {step})" if step < _HIGHEST else "1" for step in steps)
        else:
            counted = f"[{', '.join(map(str, steps))}].iter().filter(|&&step: &&Code| {code} <= step).count() as u16"
        return f"{joint.weight} * ({counted})" if joint.weight > 1 else f"({counted})"
    if len(joint.bins) == 1 << layout.code_bits:
        return f"u16::from(BINS_{table}[usize::from({code})])"
    last = joint.first + len(joint.bins) - 1
    return f"u16::from(BINS_{table}[usize::from({code}.clamp({joint.first}, {last}) - {joint.first})])"


def _distance(slope: "Slope") -> str:
    above = f"(i32::from(codes[{slope.joint}]).clamp({slope.low}, {slope.high}) - {slope.low})"
    shift = f" {'<<' if slope.gain > 0 else '>>'} {abs(slope.gain)}" if slope.gain else ""
    return f"(({above}{shift}) - {slope.zero}) as i16"


MEMBER = Rust(
    name="rust",
    part="rust",
    title="Rust",
    help="a Rust crate, no_std and without dependencies",
    next_step="`cargo test --manifest-path {folder}/Cargo.toml` compiles and tests it",
    rank=42,
    own_layout=False,
    kind="rust",
)
