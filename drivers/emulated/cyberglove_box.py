"""The box of an emulated CyberGlove: commands in, replies and records out, without a clock or a line."""

from dataclasses import dataclass
from enum import Enum
from typing import Literal

from ..cyberglove_protocol import (
    ALWAYS,
    LIGHT,
    MASK_18,
    MASK_22,
    PLUGGED,
    POLL,
    READY,
    REPLY_BYTES,
    RESTART,
    SET,
    STOP,
    STREAM,
    SWITCH,
    masked_sensors,
)
from ..errors import SettingError

MASKS = {18: MASK_18, 22: MASK_22}
VERSIONS = bytes([2, 4, 0, 1])  # firmware and information format: arbitrary
_SWITCHES = "DFJLQUWY"  # settings that are 0 or 1
_NOT_READY = 1
_REINITIALISE = b"\x09"  # Ctrl-I
_TEXT_END = b"\r\n\0"
_LONGEST_TEXT = 64
_ALL_ACTUATORS = 255


class GloveState:
    """A glove of 18 or 22 sensors and its box.

    not_ready  number of replies 1 to ?G before the reply 3

    plugged is whether the glove is connected to its box. `settings` holds the settings of the box, by letter.
    """

    def __init__(self, sensors: int, not_ready: int) -> None:
        if sensors not in MASKS:
            raise SettingError(f"there are CyberGloves of 18 and of 22 sensors, not of {sensors}")
        self.sensors = sensors
        self.plugged = True
        self.sends_all = False
        self._not_ready = not_ready
        self._all = masked_sensors(MASKS[sensors])
        self.values = bytes([100] * sensors)
        self.settings: dict[str, bytes] = {}
        self.reset()

    def reset(self) -> None:
        """Reset to the state after power-up. (No source gives a real box's settings then.)"""
        self.settings = dict.fromkeys(_SWITCHES, b"\0") | {"J": b"\1", "B": b"\0", "T": bytes(4)}
        self.settings |= {"M": MASKS[self.sensors], "N": bytes([self.sensors])}

    def set(self, values: bytes) -> None:
        """Set the sensor values, one byte of 1 to 255 per sensor. Raises SettingError for others."""
        if len(values) != self.sensors or 0 in values:
            raise SettingError(f"a CyberGlove's {self.sensors} sensors need as many bytes of 1 to 255, not {values!r}")
        self.values = values

    def is_on(self, letter: str) -> bool:
        """Return whether a setting of 0 or 1 is on."""
        return self.settings[letter] != b"\0"

    def turn_switch(self, on: bool) -> None:
        """Turn the switch at the wrist, which also turns the light while setting J is on."""
        self.settings["W"] = bytes([on])
        if self.is_on("J"):
            self.settings["L"] = bytes([on])

    def apply(self, letter: str, values: bytes) -> bool:
        """Apply the setting of this letter, and return whether it is valid."""
        if letter in _SWITCHES and values[0] > 1:
            return False
        if letter == "N" and not 1 <= values[0] <= len(masked_sensors(self.settings["M"])):
            return False
        if letter == "M":
            self.settings["N"] = bytes([len(self._masked(values))])
        self.settings[letter] = values
        if letter == "W":
            self.turn_switch(values != b"\0")
        return True

    def reply(self, letter: str) -> bytes | None:
        """Return the values in the reply to the query of this letter, None if there is no such query."""
        if letter not in REPLY_BYTES and letter != "C":
            return None
        computed = {"G": self._readiness, "P": self._flags, "C": self._calibration}
        constant = {"S": bytes([self.sensors]), "K": MASKS[self.sensors], "R": b"\1", "V": VERSIONS, "A": bytes(6)}
        return computed[letter]() if letter in computed else constant.get(letter) or self.settings[letter]

    def record(self, *, streamed: bool, too_fast: bool = False, ticks: int = 0) -> bytes:
        """Return a record's bytes on the wire; ticks is the box's clock, in 1/115200 s."""
        stamp = _stamp(ticks) if self.is_on("D") else b""
        status = bytes([self._status()]) if self.is_on("U") else b""
        fault = b"eg" if not self.plugged else b"es" if too_fast else b""
        return (STREAM if streamed else POLL) + self.sent() + stamp + status + fault + b"\0"

    def sent(self) -> bytes:
        """Return the values of the sensors that mask and number let through, or all if the box ignores its mask."""
        if self.sends_all:
            return self.values
        names = self._masked(self.settings["M"])[: self.settings["N"][0]]
        return bytes(self.values[self._all.index(name)] for name in names)

    def _masked(self, mask: bytes) -> list[str]:
        return [name for name in masked_sensors(mask) if name in self._all]

    def _status(self) -> int:
        return ALWAYS | PLUGGED * self.plugged | SWITCH * self.is_on("W") | LIGHT * self.is_on("L")

    def _readiness(self) -> bytes:
        if self._not_ready:
            self._not_ready -= 1
            return bytes([_NOT_READY])
        return bytes([READY if self.plugged else _NOT_READY])

    def _flags(self) -> bytes:
        second = sum(self.is_on(letter) << bit for bit, letter in ((2, "U"), (3, "J"), (4, "F"), (5, "D")))
        right_and_valid = 0x40 | 0x80 * self.plugged
        return bytes([self._status() & ~ALWAYS, second | right_and_valid, int(self.is_on("Q"))])

    def _calibration(self) -> bytes:
        """Return offsets, then gains, all the same. (asr reads them so; another driver reads triples.)"""
        count = self.settings["N"][0]
        return bytes([64] * count + [128] * count)


def _stamp(ticks: int) -> bytes:
    """Return a time stamp: flags of the four bytes that are 0, then the bytes, lowest first, with 1 in place of 0.

    The first byte's highest bit is 0, as ViSTA's authors observed (the manual says 1), so the byte may be a NUL.
    """
    counter = (ticks & 0xFFFFFFFF).to_bytes(4, "little")
    zeros = sum((byte == 0) << place for place, byte in enumerate(counter))
    return bytes([zeros]) + counter.replace(b"\0", b"\1")


class Action(Enum):
    """Actions that need a clock."""

    POLLED = "a record is requested"
    POLLED_AS_TEXT = "a record is requested in the text dialect"
    RESTARTED = "the box is silent until it has restarted"


@dataclass(frozen=True, slots=True)
class Doubts:
    """Behaviour on which the sources disagree or are silent.

    error_echo   whether an error reply begins with the command's echo
    stop_echo    whether the reply to a Ctrl-C is itself and a NUL
    stray_nul    whether a NUL follows a text reply
    mask         the effect of a sensor mask: accepted, an unknown command, acknowledged and ignored, or reported back
                 but without effect
    """

    error_echo: bool = True
    stop_echo: bool = False
    stray_nul: bool = False
    mask: Literal["taken", "unknown", "ignored", "feigned"] = "taken"


class CyberGloveBox:
    """Understands the commands of `docs/reference/devices.md`, in both dialects. While it streams, only Ctrl-C."""

    def __init__(self, state: GloveState, text: str, doubts: Doubts) -> None:
        self.state, self.text, self.doubts = state, text, doubts
        state.sends_all = doubts.mask == "feigned"
        self.streaming = False
        self._pending = b""

    def feed(self, data: bytes) -> list[bytes | Action]:
        """Return the effects of `data`, in order: bytes to send at once, and actions that take time."""
        self._pending += data
        out: list[bytes | Action] = []
        while self._pending:
            used = self._streaming(out) if self.streaming else self._command(out)
            if not used:
                break
            self._pending = self._pending[used:]
        return out

    def _streaming(self, out: list[bytes | Action]) -> int:
        if self._pending.startswith(STOP):
            return self._stop(out)
        return 1  # a streaming box ignores commands

    def _command(self, out: list[bytes | Action]) -> int:
        """Execute the first pending command; return its length, 0 while it is incomplete."""
        first = self._pending[:1]
        if first in (STOP, RESTART, _REINITIALISE):
            return self._control(first, out)
        if first in b"\r\n \0":
            return 1
        if first == b"?":
            return self._query(out)
        return self._text(first, out) if first.islower() else self._binary(first, out)

    def _control(self, first: bytes, out: list[bytes | Action]) -> int:
        if first == STOP:
            return self._stop(out)
        if first == RESTART:
            self.state.reset()
            out.append(Action.RESTARTED)
        out.append(first + _TEXT_END)
        return 1

    def _stop(self, out: list[bytes | Action]) -> int:
        self.streaming = False
        if self.doubts.stop_echo:
            out.append(STOP + b"\0")
        return 1

    def _query(self, out: list[bytes | Action]) -> int:
        echo = self._pending[:2]
        if len(echo) < 2:
            return 0
        letter = echo[1:].decode("latin-1")
        values = self.state.reply(letter.upper())
        if letter == "i":
            self._say_text(echo + self.text.encode("ascii"), out)
        elif values is None:
            out.append(self._error(echo, b"?"))
        elif letter.isupper():
            out.append(echo + values + b"\0")
        else:
            self._say_text(b" ".join([echo, _decimals(letter, values)]), out)
        return 2

    def _binary(self, first: bytes, out: list[bytes | Action]) -> int:
        letter = first.decode("latin-1")
        if first in (POLL, STREAM):
            self.streaming = first == STREAM
            out += [] if self.streaming else [Action.POLLED]
            return 1
        size = self._size(letter)
        if size is None:
            out.append(self._error(first, b"?"))
            return 1
        if len(self._pending) < size:
            return 0
        ignored = letter in "AC" or (letter == "M" and self.doubts.mask == "ignored")
        is_set = ignored or self.state.apply(letter, self._pending[1:size])
        out.append(first + b"\0" if is_set else self._error(first, b"n"))
        return size

    def _size(self, letter: str) -> int | None:
        """Return the length of the binary command of this letter, None if there is none."""
        second = self._pending[1:2]
        if letter == "A":  # actuators: places and amplitudes, or all six amplitudes
            return 2 + (6 if second == bytes([_ALL_ACTUATORS]) else 2 * int.from_bytes(second, "big"))
        if letter == "C":  # all offsets and gains of the hardware, or one of them
            return 2 + 2 * (self.state.settings["N"][0] if second == b"A" else 1)
        return 1 + SET[letter] if letter in SET and not (letter == "M" and self.doubts.mask == "unknown") else None

    def _text(self, first: bytes, out: list[bytes | Action]) -> int:
        if first == POLL.lower():
            out.append(Action.POLLED_AS_TEXT)
            return 1
        line, end, _ = self._pending.partition(b"\r")
        if not end and len(line) < _LONGEST_TEXT:
            return 0
        letter = first.decode("latin-1").upper()
        values = _numbers(letter, line[1:])
        if letter not in SET:
            out.append(self._error(first, b"?"))
        elif values is None or not self.state.apply(letter, values):
            out.append(self._error(first, b"n"))
        else:
            self._say_text(first, out)
        return len(line) + len(end)

    def polled_as_text(self) -> bytes:
        """Return a record in the text dialect: letter and decimal numbers."""
        return b" ".join([b"g", *(b"%d" % value for value in self.state.sent())]) + _TEXT_END

    def _say_text(self, text: bytes, out: list[bytes | Action]) -> None:
        out.append(text + _TEXT_END + b"\0" * self.doubts.stray_nul)

    def _error(self, echo: bytes, kind: bytes) -> bytes:
        return echo * self.doubts.error_echo + b"e" + kind + b"\0"


def _decimals(letter: str, values: bytes) -> bytes:
    """Return values as text; the period's and the versions' are words."""
    size = 2 if letter in "tv" else 1
    places = range(0, len(values), size)
    return b" ".join(b"%d" % int.from_bytes(values[place : place + size], "big") for place in places)


def _numbers(letter: str, text: bytes) -> bytes | None:
    """Return the values of decimal numbers, None if they are invalid."""
    size = 2 if letter == "T" else 1
    words = text.split()
    if len(words) * size != SET.get(letter) or not all(word.isdigit() and len(word) <= 5 for word in words):
        return None
    numbers = [int(word) for word in words]
    if any(number >> 8 * size for number in numbers):
        return None
    return b"".join(number.to_bytes(size, "big") for number in numbers)
