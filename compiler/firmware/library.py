"""The classifier as a library that every build carries in `firmware/`: C99, and the adding in an AVR's assembly."""

from contextlib import suppress
from dataclasses import dataclass
from textwrap import wrap

from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

from .choose import Choice, choose, features
from .classifier import classifier_files
from .errors import FirmwareError
from .library_names import LIBRARY_NAME
from .targets import TARGETS, Target

_NOTE_WIDTH = 114
# What holds a build's classifier first is what its library is laid out for.
_SMALLEST_FIRST = ("atmega328p", "atmega2560", "cortex-m4", "host")


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A part, and the layout chosen for it."""

    target: Target
    choice: Choice

    @property
    def unit(self) -> str:
        """What the time of a frame is counted in."""
        return "cycles" if self.target.kind == "avr" else "instructions"

    def notes(self, *more: str) -> tuple[str, ...]:
        """Return lines for an opening comment: what was chosen and why, and what `more` there is to say."""
        return tuple(line for note in (f"Layout {self.words}.", *more) for line in wrap(note, _NOTE_WIDTH))

    @property
    def words(self) -> str:
        """What was chosen and why, in a sentence."""
        if self.target.kind == "host":
            what = features(self.choice.layout, self.target)
            return f"for this machine: {what}, as on the smallest part that holds the build"
        return f"for {self.target.part}: {self.choice.why}"

    @property
    def bound(self) -> str:
        """What stands before a cost of the model: on an AVR it is a bound, elsewhere an estimate."""
        return "at most" if self.target.counted else "about"


def smallest_fit(tables: IntegerTables, *, avr: bool = False, flash: int | None = None) -> Fit:
    """Return the smallest part that holds the tables, of the AVRs alone with `avr`, in `flash` bytes where given, or in
    all that the part has if that is less.

    Raises FirmwareError, with what kept them from the largest, if there is none.
    """
    targets = [TARGETS[part] for part in _SMALLEST_FIRST if not avr or TARGETS[part].kind == "avr"]
    for target in targets[:-1]:
        with suppress(FirmwareError):
            return _fit(tables, target, flash)
    return _fit(tables, targets[-1], flash)


def _fit(tables: IntegerTables, target: Target, flash: int | None) -> Fit:
    return Fit(target, choose(tables, target, flash=None if flash is None else min(flash, target.flash)))


def library_files(manifest: Manifest, fit: Fit) -> dict[str, str]:
    """Return name -> text of the library of the build that `manifest` describes, laid out as `fit` says."""
    avr = fit.target.kind == "avr"
    return classifier_files(LIBRARY_NAME, manifest, fit.choice.layout, avr=avr, notes=fit.notes())
