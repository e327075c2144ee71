"""The shape of a firmware target: what whoever adds one supplies."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from .. import FirmwareError
from ..costs import CORTEX_M4, Core, Cost, word_cost
from ..tools import Tool

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Answers, Frames, Lost

Mode = Literal["classify", "scan", "glove"]


@dataclass(frozen=True, kw_only=True)
class Target:
    """What firmware is made for: a core with a compiler and perhaps a simulator, or a package for a build system.

    A target is an object of this class, or of one derived from it that overrides `files`, `cost`, `run` or `missing`.
    Importing it imports neither numpy nor jinja2: its methods import what they need, so that `--help` is quick.

    Parameters
    ----------
    name : str
        What `--target` calls it.
    part : str
        What compilers and messages call it, and what is written; a board.toml as well.
    title : str, optional
        What prose calls it, if not by its part.
    help : str
        What is written for it, in a few words.
    next_step : str
        What to do with the folder that was written, which is put in for `{folder}`.
    rank : int, optional
        Targets are listed, and tried, in the order of their ranks.
    own_layout : bool, optional
        Whether layouts are chosen for its flash, RAM and costs. If not, it takes that of the smallest part of ours that
        holds the build, and nothing is counted on it.
    any_part : bool, optional
        Whether it is a package for the smallest part that holds the build, and not for a part of its own.
    carried : bool, optional
        Whether the firmware that a build carries may be laid out for it.
    alike : bool, optional
        Whether targets of its kind differ in memory alone: one of them is then enough to be verified.
    flash, ram : int, optional
        Memory in bytes.
    most_flash : int, optional
        How much of the flash a classifier takes at most unless one asks for more.
    clock_hz : int, optional
        Usual clock, by which a frontier makes times of counts; without it `thenar frontier` does not offer the target.
    core : Core, optional
        What the portable C takes there, for `cost`.
    kind : str, optional
        What `thenar verify --firmware` calls targets that run alike; "" where `run` can run nothing.
    compiler, size : Tool, optional
        The C compiler, which takes `flags`, and the program `size` that goes with it: what `--measure` needs.
    """

    avr: ClassVar[bool] = False
    """Whether an AVR's assembly adds up the rows: costs are then bounds, in cycles."""
    modes: ClassVar[tuple[Mode, ...]] = ("classify",)

    name: str
    part: str
    help: str
    title: str = ""
    next_step: str = "{folder} holds the sources to compile"
    rank: int = 100
    own_layout: bool = True
    any_part: bool = False
    carried: bool = False
    alike: bool = False
    flash: int = 1 << 30
    ram: int = 1 << 30
    most_flash: int = 1 << 30
    clock_hz: int | None = None
    core: Core = CORTEX_M4
    kind: str = ""
    compiler: Tool | None = None
    size: Tool | None = None
    flags: tuple[str, ...] = ()

    @property
    def unit(self) -> Literal["cycles", "instructions"]:
        """What the time of a frame is counted in."""
        return "cycles" if self.avr else "instructions"

    @property
    def bound(self) -> str:
        """What stands before a cost: it is a bound or an estimate."""
        return "at most" if self.avr else "about"

    @property
    def named(self) -> str:
        """The part with its article: "an atmega328p", "an stm32"."""
        return f"{'an' if self.part[0] in 'aefilmnorsx' else 'a'} {self.part}"

    @property
    def counted_on(self) -> str:
        """Where `run` counts, for a sentence: "Measured on atmega328p"."""
        return self.part

    def cost(self, layout: "Layout") -> Cost:
        """Return a bound on what the classifier of that layout costs, or an estimate that is not too low."""
        return word_cost(layout, self.core)

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text of all that is written for it: as it is here, the C99 of the library alone."""
        return dict(library.whole)

    def sources(self, library: "Library") -> dict[str, str]:
        """Return path -> text of the classifier alone, as `run` takes it: in C, unless the target says otherwise."""
        return library.files

    def said(self, library: "Library") -> str:
        """Return what there is to say of what is written, a sentence without its end; "" if there is nothing."""
        return ""

    def missing(self) -> str | None:
        """Return what keeps code from being compiled and run here, and what to install; None if nothing does."""
        return f"thenar has no simulator of {self.named}"

    def run(
        self,
        files: Mapping[str, str],
        name: str,
        layout: "Layout",
        frames: "Frames",
        *,
        incremental: bool = False,
        lost: "Lost | None" = None,
    ) -> "Answers":
        """Return what the classifier `name` answers to frames (n, F), uint8 as `layout.frame_bytes` makes them.

        files        of `sources`: path -> text
        incremental  each answer comes from update(), the change since the frame before, instead of classify()
        lost         (n, s + j) bool: the switches and the joints that are missing in each frame; what answers then take
                     is not counted

        Raises FirmwareError if a tool is missing, or the files do not compile without any warning, do not fit, or do
        not run.
        """
        raise FirmwareError(self.missing())
