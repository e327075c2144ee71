"""The wiring of the Arduino example: the pin of every input, and the other parts that a board with too few pins needs.

Where the part is known, so are the pins. Otherwise they are numbered as on an Uno or a Mega, and the sketch chooses by
the macros of its board, as `Wiring.on` does by their values: the pins of the serial port (0 and 1) and of the LED (13)
stay free, all others are used.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, count, islice
from typing import TYPE_CHECKING

from .words import comment

if TYPE_CHECKING:
    from .classifier import Library

_FIRST, _LED = 2, 13
_ON_MULTIPLEXER, _ON_REGISTER = 16, 8
_ADDRESS_PINS, _REGISTER_PINS = 4, 3  # S0 to S3; PL, CP and Q7


@dataclass(frozen=True, slots=True)
class ArduinoBoard:
    """A board of Arduino's: the values of its macros NUM_DIGITAL_PINS, PIN_A0 and NUM_ANALOG_INPUTS."""

    digital: int
    first_analog: int
    analog: int


BOARDS = {"Uno": ArduinoBoard(20, 14, 6), "Nano": ArduinoBoard(20, 14, 8), "Mega": ArduinoBoard(70, 54, 16)}


@dataclass(frozen=True, slots=True)
class Pins:
    """The usable pins of a known part: the purely digital ones, and those that are also inputs of its converter."""

    part: str
    digital: tuple[int, ...]
    analog: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Parts:
    """The shift registers 74HC165 and multiplexers CD74HC4067 that a board needs."""

    registers: int
    multiplexers: int

    def __str__(self) -> str:
        """Return them in words: "2 74HC165 and 1 CD74HC4067"; "" if there are none."""
        counts = {"74HC165": self.registers, "CD74HC4067": self.multiplexers}
        return " and ".join(f"{number} {part}" for part, number in counts.items() if number)


@dataclass(frozen=True, slots=True)
class Wiring:
    """The pins of the example; `switches` are the numbers of those that are switches and not levels of taxels."""

    switches: tuple[int, ...]
    sensors: int
    known: Pins | None = None

    @classmethod
    def of(cls, library: "Library", known: Pins | None = None) -> "Wiring":
        """Return the wiring for a build."""
        plain = (number for number, switch in enumerate(library.names.switches) if switch.threshold is None)
        return cls(tuple(plain), len(library.sensors.every), known)

    def parts(self, digital: int, analog: int) -> Parts | None:
        """Return the other parts that these numbers of usable pins need; None if even those are not enough."""
        multiplexers = -(-self.sensors // _ON_MULTIPLEXER) if analog < self.sensors else 0
        addresses = _ADDRESS_PINS if multiplexers else 0
        registers = -(-len(self.switches) // _ON_REGISTER) if digital < len(self.switches) + addresses else 0
        lacking = digital < (_REGISTER_PINS if registers else 0) + addresses or analog < multiplexers
        return None if lacking else Parts(registers, multiplexers)

    def on(self, board: ArduinoBoard) -> Parts | None:
        """Return the other parts that a board of Arduino's needs; None if even those are not enough."""
        last = board.first_analog if self.sensors else board.digital
        return self.parts(len([pin for pin in islice(_numbers(), last) if pin < last]), board.analog)

    @property
    def of_part(self) -> Parts | None:
        """What else is needed on the known part: analog pins without a sensor are digital ones."""
        assert self.known is not None
        plain, analog = len(self.known.digital), len(self.known.analog)
        outputs = self.sensors if self.sensors <= analog else -(-self.sensors // _ON_MULTIPLEXER)
        return self.parts(plain + max(analog - outputs, 0), analog)

    @property
    def pins(self) -> list[int]:
        """The digital pins in the order of their use, as many as can be needed."""
        most = max(len(self.switches), _REGISTER_PINS) + _ADDRESS_PINS
        if self.known is None:
            return list(islice(_numbers(), most))
        return list(islice(chain(self.known.digital, reversed(self.known.analog)), most))

    def needed(self, *, multiplexed: bool = False) -> int:
        """Return the smallest number of digital pins of a board on which every switch has a separate pin."""
        used = self.pins[: len(self.switches) + (_ADDRESS_PINS if multiplexed else 0)]
        return max(used, default=0) + 1

    def __str__(self) -> str:
        """Return which boards the example fits, in a sentence without its full stop."""
        if self.known is not None:
            return f"the example Recognise fits an {self.known.part} {_with(self.of_part)}"
        needs: dict[Parts | None, list[str]] = {}
        for name, board in BOARDS.items():
            needs.setdefault(self.on(board), []).append(name)
        fits = [f"{' and '.join(boards)} {_with(parts)}" for parts, boards in needs.items()]
        return f"the example Recognise fits Arduino {'; '.join(fits)}"


def _with(parts: Parts | None) -> str:
    if parts is None:
        return "in no way, for want of pins"
    return f"with {parts}" if str(parts) else "as it is"


def _numbers() -> "chain[int]":
    return chain(range(_FIRST, _LED), count(_LED + 1))


def example_values(library: "Library", wiring: Wiring) -> dict[str, object]:
    """Return the values for the example's template."""
    sensors, pins, known = library.sensors, wiring.pins, wiring.known
    parts = None if known is None else wiring.of_part
    said = [comment(f"{sensor.name}: {' and '.join(sensor.says)}") for sensor in sensors.every]
    analog = _analog_names(known, len(said))
    names = [comment(library.names.switches[number].name) for number in wiring.switches]
    of_switches = [-1] * len(names) if parts is not None and parts.registers else pins[: len(names)]
    return {
        "part": None if known is None else known.part,
        "parts": parts,
        "switches": list(zip(wiring.switches, of_switches, names, strict=False)),
        "sensors": list(zip(analog, said, strict=True)),
        "sorts": "taxels" if not sensors.joints and sensors.taxels else "joints",
        "on_pins": sensors.on_pins,
        "needed": wiring.needed(),
        "needed_multiplexed": wiring.needed(multiplexed=True),
        "register_pins": pins[:_REGISTER_PINS],
        "address_pins": pins[len(names) :][:_ADDRESS_PINS],
        "address_pins_behind_registers": pins[_REGISTER_PINS:][:_ADDRESS_PINS],
        "output_pins": analog[: -(-len(said) // _ON_MULTIPLEXER)],
    }


def _analog_names(known: Pins | None, sensors: int) -> Sequence[str]:
    if known is None:
        return [f"A{number}" for number in range(sensors)]
    there = [*map(str, known.analog)][:sensors]
    return [*there, *["0"] * (sensors - len(there))]  # multiplexers replace the rest
