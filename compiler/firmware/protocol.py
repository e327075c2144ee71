"""The portable C of a scanner board: frames, protocol, debouncing, and the early exit of a scan.

The C does no input or output: it takes bytes and times as arguments and returns bytes. It matches
`drivers.scanner_protocol`, `drivers.emulated.scanner_board.ScannerBoard`, `drivers.debounce.Debouncer` and
`runtime.scanning.decided.EarlyExit` byte for byte, given the same scans, times and received bytes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap

from thenar.drivers.scanner_protocol import MOST_ASKED, MOST_BITS, SetChannels, SetRate
from thenar.firmware_templates.rendering import render
from thenar.runtime.scanning.decided import EarlyExit
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables

from . import FirmwareError
from .words import comment

# The capacity of a HEARTBEAT in a frame whose length is one byte.
MOST_KEYS = 1960
_FOREVER_US, _LONGEST_DEBOUNCE_US, _MOST_BOARDS, _MOST_PLACES = (1 << 32) - 1, 0xFFFF, (1 << 32) - 1, 0xFFFF
_MOST_PORTS = 256
# No score leads another by as much: sums are -32767 to 32767.
_NEVER = 0xFFFF
# For lines of numbers and names, before they are indented.
_WIDTH = 100

_PORTABLE = ("thenar_time.h", *(f"thenar_{part}.{end}" for part in ("frames", "debounce", "board") for end in "hc"))


@dataclass(frozen=True, slots=True)
class BoardConfig:
    """The contents of `thenar_config.h`; the fields are those of the protocol's HELLO.

    rows, columns  of its keys, one row: wired directly      diodes  whether the keys of a matrix have diodes
    board          its number                                scan_us from scan to scan, at least `fastest_us`
    state_us, heartbeat_us  from frame to frame, 0: none     press_us, release_us  debouncing, 0: none
    channels       of its converter: with any it uses version 2 of the protocol; code_bits: of a code
    segments       whether it reports segments

    Raises FirmwareError where a value is out of its field's range, or there are more keys than `MOST_KEYS`.
    """

    rows: int
    columns: int
    diodes: bool = True
    board: int = 1
    scan_us: int = 1000
    state_us: int = 0
    heartbeat_us: int = 50_000
    press_us: int = 0
    release_us: int = 0
    fastest_us: int = 100
    channels: int = 0
    code_bits: int = 10
    segments: bool = False

    def __post_init__(self) -> None:
        for name, (least, most) in _RANGES.items():
            value = getattr(self, name)
            if not least <= value <= most:
                raise FirmwareError(f"{name} of the board is {value}: it must be {least} to {most}")
        if self.keys > MOST_KEYS:
            raise FirmwareError(f"the board has {self.rows} x {self.columns} keys: it can report at most {MOST_KEYS}")
        if self.scan_us < self.fastest_us:
            raise FirmwareError(f"scan_us of the board is {self.scan_us}: it must be at least {self.fastest_us} us")

    @property
    def kept(self) -> int:
        """The number of payload bytes kept from the host: a SET_RATE, or a SET_CHANNELS of all channels."""
        return max(SetRate.LAYOUT.size, SetChannels.LAYOUT.size + (self.channels + 7) // 8)

    @property
    def keys(self) -> int:
        """The number of keys."""
        return self.rows * self.columns


_RANGES = {
    "rows": (1, _MOST_PLACES),
    "columns": (1, _MOST_PLACES),
    "board": (0, _MOST_BOARDS),
    "scan_us": (1, _FOREVER_US),
    "state_us": (0, _FOREVER_US),
    "heartbeat_us": (0, _FOREVER_US),
    "press_us": (0, _LONGEST_DEBOUNCE_US),
    "release_us": (0, _LONGEST_DEBOUNCE_US),
    "fastest_us": (1, _FOREVER_US),
    "channels": (0, MOST_ASKED),
    "code_bits": (1, MOST_BITS),
}


def protocol_files(config: BoardConfig) -> dict[str, str]:
    """Return name -> text of a board's C files: configuration, frames, debouncing and protocol."""
    return {
        "thenar_config.h": render("board/thenar_config.h.j2", config=config),
        **{name: render(f"board/{name}.j2", config=config) for name in _PORTABLE},
    }


def decided_files(
    name: str, tables: IntegerTables, grasps: Sequence[str], ports: Sequence[Sequence[int]]
) -> dict[str, str]:
    """Return name -> text of thenar_NAME_decided.h and .c.

    name    C identifier of the build                        grasps  names of its K classes
    ports   the switches of each port, in the order in which ports are read; each switch of the build is in one of them

    Raises FirmwareError where there are no ports, more than 256, or a switch is in none; SettingError where a switch is
    in two, or is not in the build.
    """
    masks = [sum(1 << switch for switch in port) for port in ports]
    scorer = Scorer(tables)
    early = EarlyExit(scorer, masks)
    if not 1 <= len(ports) <= _MOST_PORTS:
        raise FirmwareError(f"a scan of {len(ports)} ports: early exit needs 1 to {_MOST_PORTS}")
    if missing := (1 << tables.n_switches) - 1 & ~sum(masks):
        raise FirmwareError(
            f"no port reads switch {missing.bit_length() - 1}: early exit needs every switch of the build"
        )
    names = [comment(grasp) for grasp in grasps]
    values = {
        "name": name,
        "guard": f"THENAR_{name.upper()}",
        "grasps": names,
        "columns": wrap(", ".join(names), _WIDTH),
        "n_ports": len(ports),
        "ports": [
            line for number, port in enumerate(ports) for line in wrap(f"port {number}: {_listed(port)}", _WIDTH)
        ],
        "tables": [_hurdles(scorer, early.unread(port), names) for port in range(len(ports) - 1)],
    }
    return {f"thenar_{name}_decided.{end}": render(f"board/thenar_NAME_decided.{end}.j2", **values) for end in "hc"}


def _hurdles(scorer: Scorer, unread: int, grasps: Sequence[str]) -> list[dict[str, object]]:
    """Return the required lead of each leader over every class, in steps, as lines of C."""
    rows: list[dict[str, object]] = []
    for leader, grasp in enumerate(grasps):
        steps = [
            0 if competitor == leader else min(most + (competitor < leader), _NEVER)
            for competitor, most in enumerate(scorer.reach(leader, unread))
        ]
        rows.append({"leader": grasp, "steps": wrap(", ".join(map(str, steps)), _WIDTH)})
    return rows


def _listed(port: Sequence[int]) -> str:
    return ("switches " if len(port) > 1 else "switch ") + ", ".join(map(str, port)) if port else "no switch"
