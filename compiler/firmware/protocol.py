"""The portable C of a scanner board: frames, protocol and debouncing.

The C does no input or output: it takes bytes and times as arguments and returns bytes. It matches
`drivers.scanner_protocol`, `drivers.emulated.scanner_board.ScannerBoard` and `drivers.debounce.Debouncer` byte for
byte, given the same scans, times and received bytes.
"""

from dataclasses import dataclass

from thenar.drivers.scanner_protocol import MOST_ASKED, MOST_BITS, SetChannels, SetRate
from thenar.firmware_templates.rendering import render

from . import FirmwareError

# The capacity of a HEARTBEAT in a frame whose length is one byte.
MOST_KEYS = 1960
_FOREVER_US, _LONGEST_DEBOUNCE_US, _MOST_BOARDS, _MOST_PLACES = (1 << 32) - 1, 0xFFFF, (1 << 32) - 1, 0xFFFF

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
