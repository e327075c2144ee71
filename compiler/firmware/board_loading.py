"""From `board.toml` to a Board; what is wrong in it is told with file, line, key, and what to do."""

from pathlib import Path

from thenar.runtime.toml_source import TomlText, read_source
from thenar.runtime.toml_struct import check_finite, convert

from .board import Board
from .board_checks import faults
from .errors import FirmwareError


def load_board(path: str | Path) -> Board:
    """Return the board in a TOML file. Raises FirmwareError with file, line and key."""
    return _board_of(read_source(Path(path), FirmwareError))


def parse_board(text: str, name: str = "board.toml") -> Board:
    """Return the board that `text`, which messages call `name`, is. Raises FirmwareError as `load_board` does."""
    return _board_of(TomlText(name, text, FirmwareError))


def _board_of(source: TomlText) -> Board:
    tables = source.tables()
    check_finite(source, (), tables)
    board = convert(source, (), tables, Board)
    for place, reason in faults(board):
        raise source.error(place, reason)
    return board
