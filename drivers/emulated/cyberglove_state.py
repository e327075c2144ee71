"""What an emulated CyberGlove knows and what its records look like: settings, plug, switch, light, sensors."""

from ..cyberglove_commands import ANSWERED, READY
from ..cyberglove_frame import ALWAYS, LIGHT, PLUGGED, POLLED, STREAMED, SWITCH
from ..cyberglove_sensors import MASK_18, MASK_22, masked_sensors
from ..errors import SettingError

MASKS = {18: MASK_18, 22: MASK_22}
VERSIONS = bytes([2, 4, 0, 1])  # firmware and information format: any will do
_SWITCHES = "DFJLQUWY"  # settings that are 0 or 1
_NOT_READY = 1


class GloveState:
    """A glove of 18 or 22 sensors and its box.

    not_ready  how many times ?G shall say 1 before it says 3

    plugged is whether the glove hangs on its box. What the box is told stands in `settings`, by letter.
    """

    def __init__(self, sensors: int, not_ready: int) -> None:
        if sensors not in MASKS:
            raise SettingError(f"there are CyberGloves of 18 and of 22 sensors, not of {sensors}")
        self.sensors = sensors
        self.plugged = True
        self._not_ready = not_ready
        self._all = masked_sensors(MASKS[sensors])
        self.values = bytes([100] * sensors)
        self.settings: dict[str, bytes] = {}
        self.reset()

    def reset(self) -> None:
        """Be as after power-up. (What a real box's settings are then, no source says.)"""
        self.settings = dict.fromkeys(_SWITCHES, b"\0") | {"J": b"\1", "B": b"\0", "T": bytes(4)}
        self.settings |= {"M": MASKS[self.sensors], "N": bytes([self.sensors])}

    def set(self, values: bytes) -> None:
        """Let the sensors have these values, one byte a sensor. Raises SettingError if they cannot."""
        if len(values) != self.sensors or 0 in values:
            raise SettingError(f"a CyberGlove's {self.sensors} sensors are that many bytes of 1 to 255, not {values!r}")
        self.values = values

    def is_on(self, letter: str) -> bool:
        """Return whether a setting of 0 or 1 is on."""
        return self.settings[letter] != b"\0"

    def turn_switch(self, on: bool) -> None:
        """Turn the switch at the wrist, which turns the light as long as J says so."""
        self.settings["W"] = bytes([on])
        if self.is_on("J"):
            self.settings["L"] = bytes([on])

    def apply(self, letter: str, values: bytes) -> bool:
        """Set what the letter stands for, and return whether that can be."""
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

    def answer(self, letter: str) -> bytes | None:
        """Return the values that the query of this letter has, None if there is no such query."""
        if letter not in ANSWERED and letter != "C":
            return None
        computed = {"G": self._readiness, "P": self._flags, "C": self._calibration}
        constant = {"S": bytes([self.sensors]), "K": MASKS[self.sensors], "R": b"\1", "V": VERSIONS, "A": bytes(6)}
        return computed[letter]() if letter in computed else constant.get(letter) or self.settings[letter]

    def record(self, *, streamed: bool, too_fast: bool = False, ticks: int = 0) -> bytes:
        """Return a record as it goes on the wire; ticks is the box's clock, in 1/115200 s."""
        stamp = _stamp(ticks) if self.is_on("D") else b""
        status = bytes([self._status()]) if self.is_on("U") else b""
        fault = b"eg" if not self.plugged else b"es" if too_fast else b""
        return (STREAMED if streamed else POLLED) + self.sent() + stamp + status + fault + b"\0"

    def sent(self) -> bytes:
        """Return the values of the sensors that mask and number let through."""
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
        """Offsets, then gains, all the same. (asr reads them so; another driver reads triples.)"""
        count = self.settings["N"][0]
        return bytes([64] * count + [128] * count)


def _stamp(ticks: int) -> bytes:
    """Return a time stamp: which of the four bytes are really 0, then these, lowest first, 1 in place of 0.

    The first byte's highest bit is left 0, as ViSTA's authors saw it (the manual says 1): it may be a NUL.
    """
    counter = (ticks & 0xFFFFFFFF).to_bytes(4, "little")
    zeros = sum((byte == 0) << place for place, byte in enumerate(counter))
    return bytes([zeros]) + counter.replace(b"\0", b"\1")
