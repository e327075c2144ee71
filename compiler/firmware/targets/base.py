"""The interface of a firmware target, which a new target implements."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from .. import FirmwareError
from ..tools import Tool

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Frames, Lost, Predictions


@dataclass(frozen=True, slots=True)
class Formula:
    """What a classifier costs: the cycles of each of `costs.terms`, and the bytes of flash and RAM of the core."""

    cycles: tuple[float, ...]
    flash: int
    ram: int


@dataclass(frozen=True, kw_only=True)
class Target:
    """A firmware target: a core with a compiler and perhaps a simulator, or a package for a build system.

    A target is an object of this class, or of a derived class that overrides `files`, `run` or `missing`.
    Importing it imports neither numpy nor jinja2, so that `--help` is fast: its methods import what they need.

    Parameters
    ----------
    name : str
        Its name for `--target`.
    part : str
        Its name for compilers and messages, and in generated files.
    title : str, optional
        Its name in prose, by default that of the part.
    help : str
        A short description of the files written for it.
    next_step : str
        How to use the folder that was written, whose path replaces `{folder}`.
    rank : int, optional
        Targets are listed, and tried, in the order of their ranks.
    any_part : bool, optional
        Whether it is a package for the smallest part that holds the build, and not for one part.
    carried : bool, optional
        Whether the firmware that a build carries may be for it.
    flash, ram : int, optional
        Memory in bytes.
    most_flash : int, optional
        The default limit of flash for a classifier.
    clock_hz : int, optional
        Usual clock, which converts counts to times on a Pareto front; `thenar frontier` requires it.
    formula : Formula, optional
        The cost of the classifier on it; None where nothing is estimated, and everything fits.
    kind : str, optional
        The name in `thenar verify --firmware` of targets that differ in memory alone: the smallest that fits is
        verified. "" where `run` cannot run anything.
    compiler : Tool, optional
        The C compiler, called with `flags`, whose name ends in gcc; binutils is next to it. `--measure` needs it.
    """

    avr: ClassVar[bool] = False
    """Whether it is an AVR: costs are then in cycles."""

    name: str
    part: str
    help: str
    title: str = ""
    next_step: str = "{folder} holds the sources to compile"
    rank: int = 100
    any_part: bool = False
    carried: bool = False
    flash: int = 1 << 30
    ram: int = 1 << 30
    most_flash: int = 1 << 30
    clock_hz: int | None = None
    formula: Formula | None = None
    kind: str = ""
    compiler: Tool | None = None
    flags: tuple[str, ...] = ()

    @property
    def unit(self) -> Literal["cycles", "instructions"]:
        """The unit of the time of a frame."""
        return "cycles" if self.avr else "instructions"

    @property
    def named(self) -> str:
        """The part with its article: "an atmega328p", "an stm32"."""
        return f"{'an' if self.part[0] in 'aefilmnorsx' else 'a'} {self.part}"

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text of all files for the target; by default only the C99 of the library."""
        return dict(library.whole)

    def sources(self, library: "Library") -> dict[str, str]:
        """Return path -> text of the classifier alone, for `run`: in C, unless the target overrides it."""
        return library.files

    def missing(self) -> str | None:
        """Return why code cannot be compiled and run here, and what to install; None if it can."""
        return f"thenar has no simulator of {self.named}: measure its cost on the board"

    def run(
        self, files: Mapping[str, str], name: str, layout: "Layout", frames: "Frames", *, lost: "Lost | None" = None
    ) -> "Predictions":
        """Return the predictions of the classifier `name` for frames (n, F), uint8 from `layout.frame_bytes`.

        files  from `sources`: path -> text
        lost   (n, s + j) bool: the switches and the joints that are missing in each frame; costs are then not counted

        Raises FirmwareError if a tool is missing, or the files do not compile without warnings, do not fit, or do not
        run.
        """
        raise FirmwareError(self.missing())
