"""The firmware of a board without its classifier and its protocol: its main turn, and the layer for its part."""

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Protocol

from thenar.drivers.scanner_protocol import OVERHEAD, Analog
from thenar.runtime.harness.wiring import BusWiring, Harness
from thenar.runtime.manifest import Calibration
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.scanmap import Port
from thenar.runtime.tables import IntegerTables

from . import FirmwareError, avr_layer, sketch_layer
from .board import Board, check_switches, glove_toml, key_names, keys_of, rows_and_columns
from .board_inputs import check_joints, expanders_file, glove_file, portable, wrapped
from .layout import NO_SWITCH, Layout, Ports
from .protocol import BoardConfig
from .segments import segmenter_bytes
from .targets.base import Mode
from .words import Names, answers_of

# Cycles of the firmware as counted by libsimavr, rounded up: of a scan regardless of inputs, a key, a byte on the bus
# in addition to its SCL periods, a reading, a byte of an ANALOG frame; and of a prediction, a lookup in it, and a class
# of a lookup. The interrupts of a converter take less than a tenth.
_SCAN, _KEY, _BUS_BYTE, _READING, _ANALOG_BYTE = 3000, 60, 110, 600, 80
_PREDICTION, _LOOKUP, _CLASS = 600, 40, 10
_STATE = 100  # per state, of a tick of segments
# Parts with an Arduino core count as an AVR at 16 MHz; none of them is slower, but their Wire takes longer.
_WIRE_US = 200  # of a reading, in addition to its SCL periods


class Layer(Protocol):
    """The layer between the portable firmware of a board and its part; each method returns name -> text."""

    def base_files(self, board: Board, about: str) -> dict[str, str]:
        """Return the main program, the clock, and the host line."""

    def keys_files(self, board: Board, switches: Sequence[str]) -> dict[str, str]:
        """Return the files that read switches on pins or in a matrix."""

    def bus_files(self, board: Board) -> dict[str, str]:
        """Return the I2C bus master."""

    def uart_files(self, board: Board, number: int, baud: int) -> dict[str, str]:
        """Return a UART for a CyberGlove."""

    def joints_files(self, name: str, board: Board, joints: Sequence[Calibration]) -> dict[str, str]:
        """Return the files that read joints on the converter."""

    def channels_files(self, board: Board) -> dict[str, str]:
        """Return the files that read taxels on the converter; empty for a board without taxels."""

    def folder(self, name: str, board: Board, mode: Mode, files: Mapping[str, str]) -> dict[str, str]:
        """Return the whole folder, which contains `files`."""


def _layer(board: Board) -> Layer:
    return sketch_layer if board.avr is None else avr_layer


def readings(board: Board, switches: Sequence[str]) -> tuple[Port, ...]:
    """Return the readings of the board's chips that show a build's `switches`, in the order in which they are made.

    Each chip has as few readings as possible. A board without chips has none. Raises FirmwareError if the
    board lacks a switch.
    """
    check_switches(board, switches)
    return plan_scan(switches, harness_of(board)).ports if board.chips and switches else ()


def harness_of(board: Board) -> Harness:
    """Return the board's chips as a harness of one bus."""
    return Harness(name="board", buses=(BusWiring(device="bus", clock_hz=board.bus.clock_hz, chips=board.chips),))


def follows_segments(board: Board, names: Names) -> bool:
    """Return whether a glove on this board follows segments: its build has segment costs, and the part enough RAM."""
    model, ram = names.segments, board.microcontroller.ram
    return model is not None and segmenter_bytes(model) <= ram * _MOST_RAM


def shortest_scan_us(
    board: Board, switches: Sequence[str], tables: IntegerTables, *, recognises: bool, segments: bool = False
) -> int:
    """Return the longest duration of a scan in microseconds, with all work done once per scan, rounded up to 50."""
    ports = readings(board, switches)
    rows, columns = rows_and_columns(board, switches)
    cycles = _SCAN + _KEY * rows * columns
    seconds = 0.0
    if board.matrix is not None:
        seconds += rows * board.matrix.settle_us / 1e6
    for port in ports:
        reading = next(each for each in board.chips[port.chip].chip.readings if each.name == port.reading)
        seconds += reading.scl_periods / board.bus.clock_hz + (_WIRE_US / 1e6 if board.avr is None else 0.0)
        cycles += _READING + _BUS_BYTE * reading.wire_bytes
    if board.channels and not recognises:
        cycles += _ANALOG_BYTE * (OVERHEAD + Analog.LAYOUT.size + 2 * board.channels)
        cycles += cycles // 10
    if recognises:
        lookups = tables.n_switches // 2 + tables.n_joints
        cycles += _PREDICTION + lookups * (_LOOKUP + _CLASS * tables.n_classes)
        cycles += _STATE * (tables.n_classes + 1) * segments
    return 50 * ceil((seconds + cycles / board.clock_hz) * 1e6 / 50)


def config_of(
    board: Board, switches: Sequence[str], tables: IntegerTables, *, recognises: bool = False, segments: bool = False
) -> BoardConfig:
    """Return the configuration of the protocol's C. Raises FirmwareError if the board lacks a switch, has too many
    keys, or is set to scan faster than it can.
    """
    rows, columns = rows_and_columns(board, switches)
    return BoardConfig(
        rows=rows,
        columns=columns,
        diodes=board.matrix is None or board.matrix.diodes,
        board=board.board,
        scan_us=board.scan_us,
        state_us=board.state_us,
        heartbeat_us=board.heartbeat_us,
        press_us=board.debounce.press_us,
        release_us=board.debounce.release_us,
        fastest_us=shortest_scan_us(board, switches, tables, recognises=recognises, segments=segments),
        segments=segments,
        channels=0 if recognises else board.channels,
        code_bits=board.microcontroller.code_bits,
    )


_MOST_GRASPS = 255  # a grasp is a byte on the line, and 255 means none
_MOST_RAM = 3 / 8  # for segments; lines, keys and stack need some 900 bytes
_BYTE = 0xFF
_NUMBERS_A_LINE = 14


def board_files(name: str, names: Names, layout: Layout, board: Board, mode: Mode) -> dict[str, str]:
    """Return file name -> text of a board's firmware without the files of the classifier and of the protocol.

    name  of the build, also used for its classifier's files; a name that words.check_name allows
    mode  "scan", or "glove", which also recognises

    `config_of` gives the argument for the protocol's files; `whole_folder` takes all files. Raises
    FirmwareError if the board lacks a switch or, for a glove, a joint; if there are more than 255 grasp types; or if a
    scan takes longer than scan_us.
    """
    switches = keys_of(board, names.switches)
    check_switches(board, switches)
    if mode == "glove" and len(answers_of(names)) > _MOST_GRASPS:
        raise FirmwareError(
            f"{len(answers_of(names))} grasp types: a board can report {_MOST_GRASPS}; compile fewer grasp types"
        )
    ports = readings(board, switches)
    about = _about_glove(board, names) if mode == "glove" else _about_scanner(board)
    files = {f"{part}.h": portable(f"{part}.h") for part in ("thenar_clock", "thenar_due")}
    files |= {"thenar_due.c": portable("thenar_due.c"), "thenar_turn.h": portable("thenar_turn.h", about=about)}
    files |= _layer(board).base_files(board, about)
    files |= _inputs(board, switches)
    joints = _joints(name, names, layout, board) if mode == "glove" else {}
    files |= joints
    if mode == "glove":
        files["thenar_turn.c"] = _glove_turn(name, names, board, bool(joints))
    else:
        files |= _layer(board).channels_files(board)
        files["thenar_turn.c"] = portable("scan_turn.c", chips=len(ports), channels=board.channels)
    if any('#include "thenar_flash.h"' in each for each in files.values()):
        files["thenar_flash.h"] = portable("thenar_flash.h")
    files["glove.toml"] = glove_toml(name, board, names)
    return files


def _inputs(board: Board, switches: Sequence[str]) -> dict[str, str]:
    ports = readings(board, switches)
    layer, header = _layer(board), portable("thenar_keys.h", what=_inputs_in_words(board), chips=len(ports))
    files = {"thenar_keys.h": header}
    if board.matrix is not None or board.pins or not switches:
        return files | layer.keys_files(board, switches)
    return files | layer.bus_files(board) | {"thenar_expanders.c": expanders_file(board, ports, switches)}


def _joints(identifier: str, names: Names, layout: Layout, board: Board) -> dict[str, str]:
    check_joints(board, names.joints, layout.code_bits)
    if not names.joints:
        return {}
    what = "a CyberGlove on a UART" if board.cyberglove is not None else "voltages on the part's converter"
    glove, layer = board.cyberglove, _layer(board)
    header = portable("thenar_joints.h", name=identifier, what=what, attended=glove is not None)
    files = {"thenar_joints.h": header}
    if glove is None:
        return files | layer.joints_files(identifier, board, names.joints)
    files["thenar_cyberglove.c"] = glove_file(identifier, glove, names.joints)
    return files | layer.uart_files(board, glove.uart, glove.baud)


def _glove_turn(identifier: str, names: Names, board: Board, joints: bool) -> str:
    switches = tuple(switch.name for switch in names.switches)
    return portable(
        "glove_turn.c",
        name=identifier,
        joints=joints,
        attended=joints and board.cyberglove is not None,
        chips=bool(board.chips),
        ghosts=board.matrix is not None and not board.matrix.diodes,
        segments=follows_segments(board, names),
        many_keys=len(key_names(board, switches)) > _BYTE,
        keys_of_switches=_keys_of_switches(board, switches),
        rejects=names.rejection is not None,
    )


def key_ports(board: Board, switches: Sequence[str]) -> Ports:
    """Return all bytes of the bitmap of the board's keys as ports of a build's `switches`."""
    numbers = {name: number for number, name in enumerate(switches)}
    keys = [numbers.get(key, NO_SWITCH) for key in key_names(board, switches)]
    return tuple(tuple(keys[at : at + 8]) for at in range(0, len(keys), 8))


def _keys_of_switches(board: Board, switches: Sequence[str]) -> list[str]:
    """Return, as lines of C, the key of each switch of a matrix; with other wirings, key k is switch k."""
    if board.matrix is None:
        return []
    places = {name: key for key, name in enumerate(key_names(board, switches))}
    keys = [places[name] for name in switches]
    return [
        ", ".join(f"{key}u" for key in keys[at : at + _NUMBERS_A_LINE]) for at in range(0, len(keys), _NUMBERS_A_LINE)
    ]


def _inputs_in_words(board: Board) -> str:
    if board.matrix is not None:
        diodes = "with" if board.matrix.diodes else "without"
        return f"a matrix of {len(board.matrix.rows)} rows and {len(board.matrix.columns)} columns {diodes} diodes"
    if not (board.pins or board.chips):
        return "no switches (the single key that the protocol requires always reads as open)"
    return "switches on pins" if board.pins else "switches on port expanders"


def _about_scanner(board: Board) -> str:
    reads = f"A scanner board. It reads {_inputs_in_words(board)}, and sends them to the host"
    if board.channels:
        keys = f"{_inputs_in_words(board)}, and " if board.matrix is not None or board.pins or board.chips else ""
        reads = f"A scanner board. It reads {keys}taxels on the part's converter, and sends them to the host"
    return wrapped(f"{reads} (protocol {2 if board.channels else 1} of thenar's scanner board).", 3)


def _about_glove(board: Board, names: Names) -> str:
    reads = f"A glove that recognises grasps on its board. It reads {_inputs_in_words(board)}"
    tells = "sends them and the grasp type to the host (protocol 1 of thenar's scanner board)"
    follows = f" {said}." if (said := segments_in_words(board, names)) else ""
    return wrapped(f"{reads}, and {tells}.{follows}", 3)


def segments_in_words(board: Board, names: Names) -> str:
    """Return a sentence on whether a glove on this board follows segments; "" where its build has no segment costs."""
    if names.segments is None:
        return ""
    ram = board.microcontroller.ram
    takes = f"{segmenter_bytes(names.segments)} of {ram} bytes of RAM"
    if follows_segments(board, names):
        return f"It follows segments, which takes {takes}"
    return f"Segments are left out: they would take {takes}; the limit is {int(ram * _MOST_RAM)}"


def whole_folder(name: str, board: Board, mode: Mode, files: Mapping[str, str]) -> dict[str, str]:
    """Return path -> text of the whole firmware folder of the build `name`, whose files are `files`."""
    return _layer(board).folder(name, board, mode, files)
