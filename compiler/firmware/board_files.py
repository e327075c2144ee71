"""The firmware of a board but for its classifier and its protocol: from the clock to main() and the Makefile."""

from collections.abc import Sequence
from typing import Literal

from thenar.runtime.manifest import Manifest

from .board import Board
from .board_inputs import expanders_file, matrix_file, pins_file
from .board_joints import joints_file
from .board_keys import check_switches, glove_toml, key_names
from .board_modules import clock_files, twi_files, uart_files
from .board_scan import exits_early, readings
from .board_text import pair, text, wrapped
from .errors import FirmwareError
from .layout import Layout

Mode = Literal["scan", "glove"]

_MOST_GRASPS = 255  # a grasp is a byte on the line, and 255 says that there is none
_WHOLE_US = 50_000  # between whole scans of a board that sends no heartbeats
_NO_SWITCH, _NO_SWITCH_OF_MANY = 0xFF, 0xFFFF
_NUMBERS_A_LINE = 14


def board_files(name: str, manifest: Manifest, layout: Layout, board: Board, mode: Mode) -> dict[str, str]:
    """Return file name -> text of a board's firmware but the classifier's and the protocol's files and the Makefile.

    name  of the build, as its classifier's files are called; a name that words.check_name allows
    mode  "scan", or "glove", which also recognises

    `board_scan.config_of` and `switches_of` say what the protocol's files are to be made with. Raises FirmwareError if
    the board lacks a switch or, for a glove, a joint; if there are more than 255 grasp types to tell of; or if a scan
    takes longer than scan_us.
    """
    switches = tuple(switch.name for switch in manifest.switches)
    check_switches(board, switches)
    if mode == "glove" and len(manifest.grasps) > _MOST_GRASPS:
        raise FirmwareError(f"{len(manifest.grasps)} grasp types: a board can tell {_MOST_GRASPS} apart")
    ports = readings(board, switches, layout.tables)
    files = clock_files(board) | uart_files(board, 0, board.baud, receive_bytes=128, send_bytes=256)
    files |= _inputs(board, switches, layout)
    files |= pair("thenar_reset") | pair("thenar_due")
    joints = _joints(name, manifest, layout, board) if mode == "glove" else {}
    files |= joints
    if mode == "glove":
        files["main.c"] = _glove_main(name, manifest, board, bool(joints), exits_early(board, ports))
    else:
        files["main.c"] = text("scan_main.c", about=_about_scanner(board), chips=len(ports))
    files["glove.toml"] = glove_toml(name, board, manifest)
    return files


def _inputs(board: Board, switches: Sequence[str], layout: Layout) -> dict[str, str]:
    ports = readings(board, switches, layout.tables)
    files = {"thenar_keys.h": text("thenar_keys.h", what=_inputs_in_words(board), chips=len(ports))}
    if board.matrix is not None:
        return files | {"thenar_matrix.c": matrix_file(board, board.matrix)}
    if board.pins:
        return files | {"thenar_pins.c": pins_file(board, switches)}
    return files | twi_files(board) | {"thenar_expanders.c": expanders_file(board, ports, switches)}


def _joints(identifier: str, manifest: Manifest, layout: Layout, board: Board) -> dict[str, str]:
    files = joints_file(identifier, board, manifest.joints, layout.code_bits)
    if not files:
        return {}
    what = "a CyberGlove on a UART" if board.cyberglove is not None else "voltages on the part's converter"
    files["thenar_joints.h"] = text(
        "thenar_joints.h", name=identifier, what=what, attended=board.cyberglove is not None
    )
    if board.cyberglove is not None:
        files |= uart_files(board, board.cyberglove.uart, board.cyberglove.baud, receive_bytes=128, send_bytes=16)
    return files


def _glove_main(identifier: str, manifest: Manifest, board: Board, joints: bool, early_exit: bool) -> str:
    switches = tuple(switch.name for switch in manifest.switches)
    few, narrow = len(switches) < _NO_SWITCH, len(switches) <= _NO_SWITCH + 1
    no_switch = _NO_SWITCH if few else _NO_SWITCH_OF_MANY
    return text(
        "glove_main.c",
        name=identifier,
        about=_about_glove(board),
        joints=joints,
        attended=joints and board.cyberglove is not None,
        chips=bool(board.chips),
        early_exit=early_exit,
        whole_us=board.heartbeat_us or _WHOLE_US,
        number_of_entry="(uint8_t)number" if narrow and not few else "number",
        number_of_key="(uint8_t)key" if narrow else "key",
        no_switch=no_switch,
        table_type="uint8_t" if few else "uint16_t",
        table_read="pgm_read_byte" if few else "pgm_read_word",
        switch_of_key=_switch_of_key(board, switches, no_switch),
    )


def _switch_of_key(board: Board, switches: Sequence[str], no_switch: int) -> list[str]:
    """Return, in lines of C, the number of the switch of each key of a matrix; elsewhere key k is switch k."""
    if board.matrix is None:
        return []
    numbers = {name: number for number, name in enumerate(switches)}
    keys = [numbers.get(key, no_switch) for key in key_names(board, switches)]
    width = min(len(board.matrix.columns), _NUMBERS_A_LINE)
    return [", ".join(f"{key}u" for key in keys[at : at + width]) for at in range(0, len(keys), width)]


def _inputs_in_words(board: Board) -> str:
    if board.matrix is not None:
        diodes = "with" if board.matrix.diodes else "without"
        return f"a matrix of {len(board.matrix.rows)} rows and {len(board.matrix.columns)} columns {diodes} diodes"
    return "switches on pins" if board.pins else "switches on port expanders"


def _about_scanner(board: Board) -> str:
    reads = f"A scanner board. It reads {_inputs_in_words(board)}, and tells the host of them"
    return wrapped(f"{reads} (protocol 1 of thenar's scanner board).", 3)


def _about_glove(board: Board) -> str:
    reads = f"A glove that recognises by itself. It reads {_inputs_in_words(board)}"
    tells = "tells the host of them and of the grasp type (protocol 1 of thenar's scanner board)"
    return wrapped(f"{reads}, and {tells}.", 3)
