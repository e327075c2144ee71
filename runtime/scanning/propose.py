"""Propose a harness for a new reduced glove: the kept switches on the fewest ports, and the fewest bytes on the bus."""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Literal

from thenar.drivers.cyberglove_protocol import SENSORS, sensors_with
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import CHIPS, Chip, Converter, expanders
from thenar.drivers.spi.chips import SPI_CHIPS

from ..errors import HarnessError
from ..harness.wiring import (
    MOST_CHANNELS,
    MOST_KEYS,
    BusWiring,
    ChipWiring,
    GloveWiring,
    Harness,
    MuxChannel,
    ScannerWiring,
    SpiWiring,
)
from ..names import list_names, nearest, taxel_and_code

# Supported by every board's I2C, and most chips; a slower chip slows it down.
CLOCK_HZ = 400_000
# The converter for taxels: the most channels on a bus, converted within the transfer that reads them.
CONVERTER = "ads7828"
# A board's converter alone has no more channels; CD74HC4067 multiply them.
_BOARD_CHANNELS = 8


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
    switches, measured = _parted(switch_names, taxels)
    expander, converter = (kind, CONVERTER) if kind in expanders() else (next(iter(CHIPS)), kind)
    spi = _on_spi(converter, measured) if converter in SPI_CHIPS else ()
    chips = (*_hung(expander, switches), *(() if spi else _hung(converter, measured)))
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
    cyberglove: GloveWiring | None = None,
) -> Harness:
    """Return a harness with all switches on one scanner board, one key each, in order, and the taxels whose levels are
    among the names on its converter.

    Raises HarnessError if no board has enough keys or channels.
    """
    switches, taxels = _parted(switch_names, ())
    kinds = (("switches", switches, MOST_KEYS, "keys"), ("taxels", taxels, MOST_CHANNELS, "channels"))
    for what, names, most, places in kinds:
        if len(names) > most:
            raise HarnessError(f"{len(names)} {what}, but one board has {most} {places}: use several boards, by hand")
    mux: Literal["cd74hc4067"] | None = "cd74hc4067" if len(taxels) > _BOARD_CHANNELS else None
    board = ScannerWiring(port=port, switches=tuple(switches), taxels=tuple(taxels), mux=mux)
    return Harness(name=name, cyberglove=cyberglove, scanners=(board,) if switch_names else ())


def propose_cyberglove(joints: Sequence[str]) -> GloveWiring | None:
    """Return a CyberGlove that measures joints of these names, or None for joints of another glove."""
    sensors = sensors_with(joints)
    if sensors is None:
        return None
    return GloveWiring(port="/dev/ttyUSB0", sensors=None if sensors == SENSORS else 22)


def own_joints(joints: Sequence[str]) -> str:
    """Return a sentence on how to read joints that no CyberGlove measures; "" for others, and without joints."""
    if not joints or sensors_with(joints) is not None:
        return ""
    return (
        f"joints {list_names(joints)} need a source of your own: a board that prints them ([[stream]] of glove.toml), "
        "the converter of a board ([analog] of board.toml), or a source that you add (docs/how-to/extend.md)"
    )


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
