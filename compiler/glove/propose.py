"""Propose a harness for a new reduced glove: the kept switches on the fewest ports, and the fewest bytes on the bus."""

from collections.abc import Iterator, Sequence
from itertools import count, islice

from thenar.drivers import cd74hc4067
from thenar.drivers.cyberglove_protocol import SENSORS, sensors_with
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import CHIPS, Chip, Converter, expanders
from thenar.drivers.spi.chips import SPI_CHIPS
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import (
    MOST_COLUMNS,
    BoardWiring,
    BusWiring,
    ChipWiring,
    GloveWiring,
    Harness,
    MuxChannel,
    SpiWiring,
    StreamWiring,
)
from thenar.runtime.names import nearest, taxel_and_code
from thenar.runtime.scanning.timing import row_us

# Supported by every board's I2C, and most chips; a slower chip slows it down.
CLOCK_HZ = 400_000
# The converter for taxels: the most channels on a bus, converted within the transfer that reads them.
CONVERTER = "ads7828"
# Of a board: the range of its converter, its rows a second, and an Uno's analog pins and LED.
_CONVERTER_RANGE, _ROWS_HZ, _ANALOG_PINS, _LED = (0.0, 1023.0), 200, 6, 13


def propose_harness(
    switch_names: Sequence[str],
    kind: str = "mcp23017",
    *,
    taxels: Sequence[str] = (),
    name: str = "proposed",
    device: str = "/dev/i2c-1",
    cyberglove: GloveWiring | None = None,
) -> Harness:
    """Return a harness with all switches on chips of one kind on one bus, the first names on the first chips, and
    `taxels`, and those whose levels are among the names, on converters.

    kind may be a converter, on I2C or SPI: switches are then on the usual expander. Each chip is read in as few
    transactions as the kind allows, and the shortest on the wire among those. Chips beyond the kind's addresses go
    behind a TCA9548A; the first ones stay in front of it. Raises HarnessError if there is no such kind, or no room
    for all switches.
    """
    if kind not in CHIPS and kind not in SPI_CHIPS:
        raise HarnessError(f"there is no chip {kind!r}{nearest(kind, [*CHIPS, *SPI_CHIPS])}")
    switches, taxels = _parted(switch_names, taxels)
    expander, converter = (kind, CONVERTER) if kind in expanders() else (next(iter(CHIPS)), kind)
    spi = _on_spi(converter, taxels) if converter in SPI_CHIPS else ()
    chips = (*_hung(expander, switches), *(() if spi else _hung(converter, taxels)))
    clock_hz = min([CLOCK_HZ, *(each.chip.clock_hz for each in chips)])
    return Harness(
        name=name,
        cyberglove=cyberglove,
        buses=(BusWiring(device=device, clock_hz=clock_hz, chips=chips),) if chips else (),
        spi=spi,
    )


def _on_spi(kind: str, names: Sequence[str]) -> tuple[SpiWiring, ...]:
    channels, left = SPI_CHIPS[kind].pins, iter(names)
    return tuple(
        SpiWiring(
            device=f"/dev/spidev0.{number}",
            kind=kind,
            pins=dict(zip(channels, islice(left, len(channels)), strict=False)),
        )
        for number in range(-(-len(names) // len(channels)))
    )


def _parted(names: Sequence[str], taxels: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the switches, and the taxels whose levels may be among the names."""
    levels = {name: level[0] for name in names if (level := taxel_and_code(name))}
    return [name for name in names if name not in levels], list(dict.fromkeys((*levels.values(), *taxels)))


def _hung(kind: str, names: Sequence[str]) -> tuple[ChipWiring, ...]:
    """Return the chips of a kind with all the names; pins are taken in order, so that the last chip uses as few ports
    as possible.
    """
    chip = CHIPS[kind]
    inputs, left = _inputs(chip), iter(names)
    return tuple(
        ChipWiring(kind=kind, address=address, mux=mux, pins=dict(zip(inputs, islice(left, len(inputs)), strict=False)))
        for address, mux in _places(chip, -(-len(names) // len(inputs)))
    )


def propose_board(
    switch_names: Sequence[str],
    *,
    name: str = "proposed",
    port: str = "/dev/ttyACM0",
    baud: int = 1_000_000,
    cyberglove: GloveWiring | None = None,
) -> Harness:
    """Return a harness with all switches on the pins of one board that prints rows, and the taxels whose levels are
    among the names on its converter of 10 bits; 200 rows come in a second, or as many as the line allows.

    Pins are numbered as on Arduino's boards: 0 and 1 (the serial port) and 13 (the LED) stay free.

    Raises HarnessError for more switches and taxels than a row can have.
    """
    switches, taxels = _parted(switch_names, ())
    columns = len(switches) + len(taxels)
    if columns > MOST_COLUMNS:
        raise HarnessError(f"{columns} switches and taxels, but a row has at most {MOST_COLUMNS}: use several boards")
    board = StreamWiring(
        port=port,
        baud=baud,
        rate_hz=float(min(_ROWS_HZ, int(1e6 / row_us(len(switches), len(taxels), baud)))),
        switches=tuple(switches),
        taxels=dict.fromkeys(taxels, _CONVERTER_RANGE),
        board=_pins(switches, taxels),
    )
    return Harness(name=name, cyberglove=cyberglove, streams=(board,) if switch_names else ())


def _pins(switches: Sequence[str], taxels: Sequence[str]) -> BoardWiring:
    digital = (str(number) for number in count(2) if number != _LED)
    pins = dict(zip(switches, digital, strict=False))
    if len(taxels) <= _ANALOG_PINS:
        return BoardWiring(pins=pins | {name: f"A{number}" for number, name in enumerate(taxels)})
    channels = (f"A{number // cd74hc4067.CHANNELS}.{number % cd74hc4067.CHANNELS}" for number in count())
    select = tuple(islice(digital, len(cd74hc4067.SELECTS)))
    return BoardWiring(pins=pins | dict(zip(taxels, channels, strict=False)), select=select)


def propose_cyberglove(joints: Sequence[str]) -> GloveWiring | None:
    """Return a CyberGlove that measures joints of these names, or None for joints of another glove."""
    sensors = sensors_with(joints)
    if sensors is None:
        return None
    return GloveWiring(port="/dev/ttyUSB0", sensors=None if sensors == SENSORS else 22)


def _inputs(chip: Chip) -> list[str]:
    """Return the names of the pins that one transaction can show and that may be inputs."""
    if isinstance(chip, Converter):
        return list(chip.pins)
    whole = max(chip.readings, key=lambda reading: reading.length)
    return [name for name in (chip.pins[pin] for pin in whole.pins if pin >= 0) if name not in chip.not_inputs]


def _places(chip: Chip, count: int) -> list[tuple[int, MuxChannel | None]]:
    """Return an address for each of `count` chips, and a channel for those behind the mux: with the fewest channels,
    and then as many chips in front of the mux as these channels allow.
    """
    addresses = len(chip.addresses)
    if count <= addresses:
        return [(address, None) for address in islice(chip.addresses, count)]
    channels = -(-count // addresses)
    if channels > len(tca9548a.CHANNELS):
        raise HarnessError(
            f"{count} {chip.name} are needed, and one bus has room for {len(tca9548a.CHANNELS) * addresses}: "
            "choose a chip with more pins, or split the switches between buses by hand"
        )
    before = (channels * addresses - count) // (channels - 1)
    return list(islice(_behind(chip, before, channels), count))


def _behind(chip: Chip, before: int, channels: int) -> Iterator[tuple[int, MuxChannel | None]]:
    yield from ((address, None) for address in chip.addresses[:before])
    for channel in range(channels):
        for address in chip.addresses[before:]:
            yield address, MuxChannel(address=tca9548a.ADDRESSES[0], channel=channel)
