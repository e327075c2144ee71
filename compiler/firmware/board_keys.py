"""The keys of a board: which switch each is, and the `glove.toml` by which the host reads them."""

from collections.abc import Sequence

from thenar.runtime.harness.wiring import Debounce, Harness, ScannerWiring
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.manifest import Manifest
from thenar.runtime.names import list_names

from .board import Board
from .errors import FirmwareError


def rows_and_columns(board: Board, switches: Sequence[str]) -> tuple[int, int]:
    """Return how many rows and columns of keys the board tells the host of; pins and chips are one row."""
    if board.matrix is not None:
        return len(board.matrix.rows), len(board.matrix.columns)
    return 1, len(switches)


def key_names(board: Board, switches: Sequence[str]) -> tuple[str, ...]:
    """Return the switch of every key, "" for none: a build's `switches` in its order, or the matrix row by row."""
    if board.matrix is not None:
        return tuple(name for row in board.matrix.switches for name in row)
    return tuple(switches)


def check_switches(board: Board, switches: Sequence[str]) -> None:
    """Raise FirmwareError unless the board has a pin or key for each of a build's `switches`."""
    wired = set(board.wired)
    lacking = [name for name in switches if name not in wired]
    if lacking:
        raise FirmwareError(
            f"the board has no pin or key for {list_names(lacking)}, which the build keeps: add what is missing to "
            "its board.toml, or compile the build for the switches that are there"
        )
    if not switches:
        raise FirmwareError(
            "the build keeps no switch, so there is nothing to scan: compile it with --inputs both or switches"
        )


def glove_toml(name: str, board: Board, manifest: Manifest, port: str = "/dev/ttyACM0") -> str:
    """Return the `glove.toml` for a host that has the board at `port`. A board that debounces is not debounced again.

    Raises FirmwareError if the board lacks a switch of the build.
    """
    switches = tuple(switch.name for switch in manifest.switches)
    check_switches(board, switches)
    line = ScannerWiring(port=port, baud=board.baud, switches=key_names(board, switches))
    debounce = Debounce(enabled=not (board.debounce.press_us or board.debounce.release_us))
    return harness_to_toml(Harness(name=name, scanners=(line,), debounce=debounce))
