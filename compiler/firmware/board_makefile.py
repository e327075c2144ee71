"""The Makefile of a board's firmware."""

from collections.abc import Collection

from .board import Board
from .board_files import Mode
from .board_text import text


def board_makefile(name: str, board: Board, mode: Mode, files: Collection[str]) -> str:
    """Return the Makefile of the firmware of the build `name` whose other files are called `files`."""
    does = "scans the switches" if mode == "scan" else "scans the switches and recognises"
    sources = sorted(file for file in files if file.endswith((".c", ".S")))
    return text(
        "Makefile",
        title=f"Firmware that {does}, for an {board.part} at {board.clock_hz} Hz.",
        program=f"thenar_{name}_{mode}",
        objects=[source.rpartition(".")[0] + ".o" for source in sources],
        headers=sorted(file for file in files if file.endswith(".h")),
        part=board.part,
        brown_out=board.microcontroller.brown_out,
        avrdude_part=board.microcontroller.avrdude,
        programmer=board.microcontroller.programmer,
    )
