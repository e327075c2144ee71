"""What a layout really takes of its part: compiled, and its slowest frames run in a simulator."""

import hashlib
from dataclasses import dataclass
from importlib.metadata import version

from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Options, Origin, Proof, Switch
from thenar.runtime.tables import IntegerTables, tables_to_bytes

from ...firmware.choose import Option
from ...firmware.classifier import classifier_files
from ...firmware.errors import FirmwareError
from ...firmware.library_names import LIBRARY_NAME
from ...firmware.probes import Probes, extreme_frames, joined
from ...firmware.running import run
from ...firmware.targets import Target
from ...firmware.worst import worst_frame


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A layout with its predicted cost, to be run on `part`."""

    option: Option
    part: Target


@dataclass(frozen=True, slots=True)
class Outcome:
    """Cycles, or instructions, as predicted and as counted of the slowest frame; microseconds on host."""

    predicted: float
    counted: float

    @property
    def error(self) -> float:
        """How far the prediction is off, as a share of what was counted."""
        return abs(self.predicted - self.counted) / self.counted


def run_trial(trial: Trial) -> Outcome:
    """Compile the layout and run the frame that should take longest, and extreme ones. Raises FirmwareError."""
    (layout, cost), part = trial.option, trial.part
    avr = part.kind == "avr"
    bits, codes = worst_frame(layout, part if avr else None)
    probes = joined(Probes(bits.reshape(1, -1), codes.reshape(1, -1)), extreme_frames(layout.tables))
    files = classifier_files(LIBRARY_NAME, nameless(layout.tables), layout, avr=avr)
    answers = run(files, LIBRARY_NAME, layout, part, layout.frame_bytes(probes.bits, probes.codes))
    if answers.cost is None:
        raise FirmwareError(f"nothing was counted on {part.part}")
    return Outcome(cost.cycles, float(answers.cost.max()))


def nameless(tables: IntegerTables) -> Manifest:
    """Return a manifest for tables that belong to no build yet: what C calls their inputs has no bearing on time."""
    digest = hashlib.sha256(tables_to_bytes(tables)).hexdigest()
    return Manifest(
        schema=SCHEMA,
        checksum="",
        thenar=version("thenar"),
        tables_sha256=digest,
        ensemble_sha256=digest,
        source=Origin(digest, 0, "own", tables.n_switches),
        options=Options(0, 1, "both", 1.0, 0, 0),
        grasps=tuple(f"type {number}" for number in range(tables.n_classes)),
        switches=tuple(Switch(number, f"s{number}", 0.0) for number in range(tables.n_switches)),
        joints=tuple(Calibration(number, f"j{number}", "raw", 0, 0.0, 1, 1.0) for number in range(tables.n_joints)),
        proof=Proof(16, tables.scale, tables.bound, 0.0, 0.0, 0, 0),
        rates=(),
    )
