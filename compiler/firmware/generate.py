"""The files of a folder of firmware: of which tables, for what, doing what."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from thenar.runtime.tables import IntegerTables

from .board import Board
from .board_files import board_files, board_makefile, config_of, exits_early, readings, switches_of
from .choose import Fit, fit_for, smallest_fit
from .classifier import LIBRARY_NAME, Library
from .errors import FirmwareError
from .protocol import decided_files, protocol_files
from .targets import TARGETS, Target
from .targets.base import Mode
from .words import Names, check_name


@dataclass(frozen=True, eq=False)
class Firmware:
    """Firmware of `tables` for `target`, one of TARGETS, in `mode`.

    names        what grasp types, switches and joints are called: a build's manifest, or words.numbered(tables)
    mode         "classify": a library; "scan": a board that scans switches; "glove": one that also recognises
    name         what its files and functions are called: lower-case letters, digits and _, at most 32
    board        how the microcontroller is wired: needed by the modes scan and glove, and only by them
    flash        how many bytes of flash the classifier may take; None: half of the part's, three quarters where half
                 is too little

    Raises FirmwareError where these do not go together, or the name cannot be one in C; MemberError if there is no
    such target.
    """

    tables: IntegerTables
    names: Names
    target: str
    mode: Mode = "classify"
    name: str = LIBRARY_NAME
    board: Board | None = None
    flash: int | None = None

    def __post_init__(self) -> None:
        check_name(self.name)
        target = self._target
        if self.mode == "classify":
            if self.board is not None:
                raise FirmwareError("the mode classify reads no board: leave the board out, or ask for scan or glove")
        elif self.mode not in target.modes:
            others = " and ".join(name for name, each in TARGETS.items() if self.mode in each.modes)
            raise FirmwareError(f"the mode {self.mode} is written for {others}, not for {self.target}")
        elif self.board is None:
            raise FirmwareError(f"the mode {self.mode} needs a board.toml: how the microcontroller is wired")
        elif self.board.part != target.part:
            raise FirmwareError(f"the board has an {self.board.part}, the target {self.target} is {target.named}")

    @property
    def _target(self) -> Target:
        return TARGETS.named(self.target)

    @cached_property
    def fit(self) -> Fit:
        """The part that it is for, and the layout chosen for it. Raises FirmwareError if no layout fits."""
        if self.mode == "scan":  # a board that only scans holds no classifier
            return smallest_fit(self.tables, flash=self.flash)
        return fit_for(self._target, self.tables, self.flash)

    def library(self, notes: Sequence[str] = ()) -> Library:
        """Return the classifier alone, with lines for its opening comments."""
        return Library(self.name, self.names, self.fit.choice.layout, self.fit.target.avr, tuple(notes))

    def files(self, notes: Sequence[str] | None = None) -> dict[str, str]:
        """Return path -> text of the firmware; the same firmware and notes give the same.

        notes are lines for the opening comment of the classifier's header, those of the fit unless given. Raises
        FirmwareError where no layout fits, or the board cannot do what is asked of it.
        """
        library = self.library(self.fit.notes() if notes is None else notes)
        return self._target.files(library) if self.board is None else self._of_board(self.board, library)

    def _of_board(self, board: Board, library: Library) -> dict[str, str]:
        name, names, tables = self.name, self.names, self.tables
        switches, glove = tuple(switch.name for switch in names.switches), self.mode == "glove"
        config = config_of(board, switches, tables, recognises=glove)
        files = protocol_files(config) | board_files(name, names, library.layout, board, self.mode)
        if glove:
            files |= library.files
            if exits_early(board, ports := readings(board, switches, tables)):
                files |= decided_files(name, tables, names.grasps, switches_of(ports))
        return files | {"Makefile": board_makefile(name, board, self.mode, files)}
