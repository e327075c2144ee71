"""The files of a folder of firmware: of which build, for what, doing what."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from thenar.runtime.build import Build

from .arduino import arduino_files
from .avr_files import avr_files
from .board import Board
from .board_files import Mode as BoardMode
from .board_files import board_files
from .board_makefile import board_makefile
from .board_scan import config_of, exits_early, readings, switches_of
from .choose import choose
from .classifier import classifier_files
from .cortex_files import cortex_files
from .errors import FirmwareError
from .host_files import host_files
from .library import Fit, smallest_fit
from .library_names import LIBRARY_NAME
from .protocol import decided_files, protocol_files
from .targets import TARGETS
from .words import check_name

Mode = Literal["classify", "scan", "glove"]
MODES: tuple[Mode, ...] = ("classify", "scan", "glove")

PLATFORMS: Mapping[str, str | None] = MappingProxyType(
    {
        "avr328p": "atmega328p",
        "avr2560": "atmega2560",
        "cortex-m0plus": "cortex-m0plus",
        "cortex-m4": "cortex-m4",
        "host": None,
        "arduino": None,
    }
)
"""What firmware can be for, and the part that its layout is chosen for; None: the smallest that holds the build."""


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """Firmware of `build` for `platform`, one of PLATFORMS, in `mode`.

    name         what its files and functions are called: lower-case letters, digits and _, at most 32
    board        how the microcontroller is wired: needed by the modes scan and glove, and only by them
    flash        how many bytes of flash the classifier may take; None: half of the part's, three quarters where half
                 is too little

    Raises FirmwareError where these do not go together, or the name cannot be one in C.
    """

    build: Build
    platform: str
    mode: Mode = "classify"
    name: str = LIBRARY_NAME
    board: Board | None = None
    flash: int | None = None

    def __post_init__(self) -> None:
        check_name(self.name)
        part = PLATFORMS[self.platform]
        if self.mode == "classify":
            if self.board is not None:
                raise FirmwareError("the mode classify reads no board: leave the board out, or ask for scan or glove")
        elif part not in ("atmega328p", "atmega2560"):
            raise FirmwareError(f"the mode {self.mode} is written for avr328p and avr2560, not for {self.platform}")
        elif self.board is None:
            raise FirmwareError(f"the mode {self.mode} needs a board.toml: how the microcontroller is wired")
        elif self.board.part != part:
            raise FirmwareError(f"the board has an {self.board.part}, the target {self.platform} is an {part}")


def fit_of(request: Request) -> Fit:
    """Return the part of a request, and the layout chosen for it; this machine has that of the smallest part.

    Raises FirmwareError if no layout fits.
    """
    part, tables = PLATFORMS[request.platform], request.build.tables
    if part is None or request.mode == "scan":  # a board that only scans holds no classifier
        fit = smallest_fit(tables, flash=request.flash)
        return Fit(TARGETS["host"], fit.choice) if request.platform == "host" else fit
    return Fit(TARGETS[part], choose(tables, TARGETS[part], flash=request.flash))


def firmware_files(request: Request, fit: Fit, notes: Sequence[str] = ()) -> dict[str, str]:
    """Return path -> text of the firmware; the same request and notes give the same.

    fit is that of `fit_of`; notes are lines for the opening comment of the classifier's header. Raises FirmwareError
    where the board cannot do what is asked of it.
    """
    if request.board is not None:
        return _of_board(request, request.board, fit, notes)
    name, manifest, layout = request.name, request.build.manifest, fit.choice.layout
    made = library(request, fit, notes)
    match request.platform:
        case "host":
            return {**made, **host_files(name, layout, manifest.grasps)}
        case "arduino":
            avr = fit.target.kind == "avr"
            sources = {f"src/{path}": text for path, text in made.items()}
            return {**sources, **arduino_files(name, manifest, layout, avr=avr)}
        case "avr328p" | "avr2560":
            return {**made, **avr_files(name, layout, fit.target)}
    return {**made, **cortex_files(name, layout, fit.target, manifest.grasps)}


def library(request: Request, fit: Fit, notes: Sequence[str] = ()) -> dict[str, str]:
    """Return name -> text of the classifier alone."""
    avr = fit.target.kind == "avr"
    return classifier_files(request.name, request.build.manifest, fit.choice.layout, avr=avr, notes=notes)


def _of_board(request: Request, board: Board, fit: Fit, notes: Sequence[str]) -> dict[str, str]:
    name, manifest, tables = request.name, request.build.manifest, request.build.tables
    switches, glove = tuple(switch.name for switch in manifest.switches), request.mode == "glove"
    config = config_of(board, switches, tables, recognises=glove)
    mode: BoardMode = "glove" if glove else "scan"
    files = protocol_files(config) | board_files(name, manifest, fit.choice.layout, board, mode)
    if glove:
        files |= library(request, fit, notes)
        if exits_early(board, ports := readings(board, switches, tables)):
            files |= decided_files(name, tables, manifest.grasps, switches_of(ports))
    return files | {"Makefile": board_makefile(name, board, mode, files)}
