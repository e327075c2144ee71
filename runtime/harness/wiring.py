"""The wiring of a glove: serial lines and buses, and the pin or column of each switch.

The structs are the tables of `glove.toml`, field by field; a loaded harness is known to be valid.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from msgspec import Meta, Struct, field

from ..taxels import TaxelSettings

if TYPE_CHECKING:
    from thenar.drivers.i2c.chips import Chip
    from thenar.drivers.spi.chips import SpiChip

# A line has no room for more.
MOST_COLUMNS = 2000
# Of a CyberGlove that does not say how many it has.
_SENSORS = 18
# Clock rates of a bus.
SLOWEST_HZ = 1000
Text = Annotated[str, Meta(min_length=1)]
Baud = Annotated[int, Meta(ge=1, le=12_000_000)]
Milliseconds = Annotated[float, Meta(ge=0.0, le=1000.0)]


class _Table(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """A table of `glove.toml`; fields with their default are omitted when it is written."""


class GloveWiring(_Table, frozen=True):
    """The CyberGlove: its port (a device or socket://), and how it is read.

    rate_hz      None: as fast as it can
    filter       whether the box's digital filter is on; None: as set on the box
    mask         whether a run omits sensors from the records that no joint of the build uses
    sensors      None: as the glove reports
    calibration  path of its calibration; relative paths in a file count from that file's folder
    joints       names of the wire's sensors, in wire order, if a build names them differently from the driver
    """

    port: Text
    baud: Baud = 115_200
    rate_hz: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    filter: bool | None = None
    mask: bool = True
    sensors: Literal[18, 22] | None = None
    calibration: Text | None = None
    joints: tuple[str, ...] = ()

    @property
    def all_sensors(self) -> int:
        """The number of sensors that the glove must have: 18 by default."""
        return len(self.joints) or self.sensors or _SENSORS

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """The names of all its sensors in wire order: ours, or the driver's."""
        from thenar.drivers.cyberglove_protocol import SENSORS_18, SENSORS_22

        return self.joints or (SENSORS_18 if self.all_sensors == _SENSORS else SENSORS_22)


class MuxChannel(_Table, frozen=True):
    """A place behind a TCA9548A."""

    address: Annotated[int, Meta(ge=0x70, le=0x77)]
    channel: Annotated[int, Meta(ge=0, le=7)]


class ChipWiring(_Table, frozen=True):
    """A port expander or a converter: its kind (a key of CHIPS), its place, and the switch or taxel on each pin.

    closed is the level of its pin at which a switch is closed: "low" if it pulls its pin down.
    """

    kind: str
    address: int
    mux: MuxChannel | None = None
    pins: dict[str, str] = {}
    closed: Literal["low", "high"] = "low"

    @property
    def chip(self) -> "Chip":
        """The driver's description of the chip."""
        from thenar.drivers.i2c.chips import CHIPS  # not every glove has one

        return CHIPS[self.kind]

    @property
    def numbered_pins(self) -> dict[int, str]:
        """The switches, or taxels, by the numbers of their pins, in the order of the numbers."""
        return _numbered(self.chip.pins, self.pins)

    @property
    def measures(self) -> bool:
        """Whether it reads taxels, not switches."""
        from thenar.drivers.i2c.chips import Converter

        return isinstance(self.chip, Converter)

    @property
    def place(self) -> str:
        """Its name in messages: "mcp23017 at 0x20" or "mcp23017 at 0x20 behind channel 2 of 0x70"."""
        behind = f" behind channel {self.mux.channel} of 0x{self.mux.address:02X}" if self.mux else ""
        return f"{self.kind} at 0x{self.address:02X}{behind}"


class BoardMatrix(_Table, frozen=True):
    """A matrix of keys on a board: one row at a time is driven low, and the columns are read with pull-ups.

    keys       the switches, one list per row, "" where there is no key
    diodes     whether every key has a diode, with its cathode towards the row
    settle_us  from driving a row low to reading the columns
    """

    rows: Annotated[tuple[Text, ...], Meta(min_length=1)]
    columns: Annotated[tuple[Text, ...], Meta(min_length=1)]
    keys: tuple[tuple[str, ...], ...]
    diodes: bool
    settle_us: Annotated[int, Meta(ge=0, le=10_000)] = 20


class BoardWiring(_Table, frozen=True):
    """The inputs of the board that prints the rows of a stream. Pins are named as in sketches: "2", "A0", "PA3".

    pins       the pin of each switch, which a closed switch connects to ground, and of each joint or taxel, an analog
               one; "A0.3" is channel 3 of the CD74HC4067 whose common pin is connected to A0
    select     the pins at S0 to S3 of all multiplexers
    settle_us  from switching the multiplexers to reading them
    matrix     switches in a matrix
    chips      port expanders on the board's I2C bus
    """

    pins: dict[str, Text] = {}
    select: tuple[Text, ...] = ()
    settle_us: Annotated[int, Meta(ge=0, le=10_000)] = 100
    matrix: BoardMatrix | None = None
    chips: tuple[ChipWiring, ...] = field(default=(), name="chip")

    @property
    def wired(self) -> tuple[str, ...]:
        """The names of everything that is wired."""
        keys = () if self.matrix is None else (name for row in self.matrix.keys for name in row if name)
        return (*self.pins, *keys, *(name for chip in self.chips for name in chip.numbered_pins.values()))


Range = tuple[float, float]


class StreamWiring(_Table, frozen=True):
    """Rows of numbers sent by a board or a program: lines (`thenar.drivers.transports`), LSL, a ROS topic.

    frame        the pattern of binary frames (`thenar.drivers.frames`); None: lines
    columns      the columns in order, "" for unused ones; (): the sender names them
    time         the column with the sender's clock, in `time_unit`
    rate_hz      rows per second
    switches     the columns that are switches: closed if the number is above the threshold, or, if `closed` is "low",
                 if it is not; `thresholds` are those of single switches
    joints       the columns that are joints, and the range of their numbers, which become the codes 1 to 255
    taxels       the columns that are taxels, and the range of their numbers: each whole number is one code
    calibration  path of a calibration of the joints
    board        the inputs of the board that prints the rows, for the sketch that `thenar firmware` writes for it
    """

    port: Text
    baud: Baud = 115_200
    frame: Text | None = None
    columns: Annotated[tuple[str, ...], Meta(max_length=MOST_COLUMNS)] = ()
    time: Text | None = None
    time_unit: Literal["s", "ms", "us"] = "ms"
    rate_hz: Annotated[float, Meta(ge=0.1, le=10_000.0)] = 50.0
    switches: Annotated[tuple[str, ...], Meta(max_length=MOST_COLUMNS)] = ()
    threshold: float = 0.5
    thresholds: dict[str, float] = {}
    closed: Literal["low", "high"] = "high"
    joints: dict[str, Range] = {}
    taxels: dict[str, Range] = {}
    calibration: Text | None = None
    board: BoardWiring | None = None

    @property
    def used(self) -> tuple[str, ...]:
        """The columns that are used, without the sender's clock."""
        return (*self.switches, *self.joints, *self.taxels)

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """The names of its joints, in the order of the frames' bytes."""
        return tuple(self.joints)

    @property
    def period_us(self) -> int:
        """The time from one row to the next."""
        return round(1e6 / self.rate_hz)


# A hand changes some ten times a second; a press is seen within 5 ms.
SCANS_HZ = 200.0
FASTEST_HZ = 10_000.0
ScanRate = Annotated[float, Meta(ge=0.1, le=FASTEST_HZ)]


class BusWiring(_Table, frozen=True):
    """An I2C bus and the chips on it; rate_hz: scans a second, at most."""

    device: Text
    clock_hz: Annotated[int, Meta(ge=SLOWEST_HZ, le=1_700_000)] = 100_000
    rate_hz: ScanRate = SCANS_HZ
    chips: tuple[ChipWiring, ...] = field(default=(), name="chip")


class SpiWiring(_Table, frozen=True):
    """A converter on SPI: its device, its kind (a key of SPI_CHIPS), its clock (None: its fastest at 3.3 V), the
    taxel on each of its channels, and how often it is read at most, in times a second. It is a bus with one chip.
    """

    mux: ClassVar[None] = None
    measures: ClassVar[bool] = True

    device: Text
    kind: str
    hz: Annotated[int, Meta(ge=SLOWEST_HZ, le=50_000_000)] | None = field(default=None, name="clock_hz")
    rate_hz: ScanRate = SCANS_HZ
    pins: dict[str, str] = {}

    @property
    def chips(self) -> tuple[Self]:
        """The only chip."""
        return (self,)

    @property
    def chip(self) -> "SpiChip":
        """The driver's description of the chip."""
        from thenar.drivers.spi.chips import SPI_CHIPS

        return SPI_CHIPS[self.kind]

    @property
    def clock_hz(self) -> int:
        """SCLK."""
        return self.hz or self.chip.clock_hz

    @property
    def numbered_pins(self) -> dict[int, str]:
        """The taxels by the numbers of their channels, in the order of the numbers."""
        return _numbered(self.chip.pins, self.pins)

    @property
    def place(self) -> str:
        """Its name in messages."""
        return f"{self.kind} at {self.device}"


def _numbered(names: Sequence[str], pins: Mapping[str, str]) -> dict[int, str]:
    return {number: pins[name] for number, name in enumerate(names) if name in pins}


class Debounce(_Table, frozen=True):
    """How switches are debounced: a press counts at once and locks out further edges, a release must last."""

    enabled: bool = True
    press_lockout_ms: Milliseconds = 5.0
    release_ms: Milliseconds = 10.0


class Harness(_Table, frozen=True):
    """A glove's wiring."""

    name: Text
    cyberglove: GloveWiring | None = None
    buses: tuple[BusWiring, ...] = field(default=(), name="bus")
    spi: tuple[SpiWiring, ...] = ()
    streams: tuple[StreamWiring, ...] = field(default=(), name="stream")
    debounce: Debounce = Debounce()
    taxel_settings: TaxelSettings = field(default=TaxelSettings(), name="taxels")

    @property
    def wires(self) -> tuple[BusWiring | SpiWiring, ...]:
        """The I2C buses, then the SPI devices: scan maps number them in this order."""
        return (*self.buses, *self.spi)

    @property
    def chips(self) -> tuple[ChipWiring | SpiWiring, ...]:
        """All chips, bus after bus."""
        return tuple(chip for wire in self.wires for chip in wire.chips)

    @property
    def switches(self) -> tuple[str, ...]:
        """The names of all wired switches: the chips', pin by pin, then the streams'."""
        chips = (name for chip in self.chips if not chip.measures for name in chip.numbered_pins.values())
        return (*chips, *(name for stream in self.streams for name in stream.switches))

    @property
    def taxel_names(self) -> tuple[str, ...]:
        """The names of all wired taxels: the converters', channel by channel, then the streams'."""
        chips = (name for chip in self.chips if chip.measures for name in chip.numbered_pins.values())
        return (*chips, *(name for stream in self.streams for name in stream.taxels))

    @property
    def joint_device(self) -> GloveWiring | StreamWiring | None:
        """The device that measures the joints: the CyberGlove, or a stream with joints."""
        return self.cyberglove or next((stream for stream in self.streams if stream.joints), None)

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """The names of the joints' sensors, in the order of their bytes in a frame."""
        device = self.joint_device
        return () if device is None else device.sensor_names

    @property
    def calibration(self) -> str | None:
        """The path of the joints' calibration."""
        return None if self.joint_device is None else self.joint_device.calibration
