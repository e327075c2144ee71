"""What a layout really takes of its part: compiled, and its slowest frames run in a simulator."""

from dataclasses import dataclass

from ...firmware.choose import Option
from ...firmware.classifier import LIBRARY_NAME, Library
from ...firmware.measuring import run_counted, slow_frames
from ...firmware.targets import Target
from ...firmware.words import numbered


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
    layout, cost = trial.option
    library = Library(LIBRARY_NAME, numbered(layout.tables), layout, trial.part.avr)
    return Outcome(cost.cycles, float(run_counted(library, trial.part, slow_frames(layout)).most))
