"""The scan map: the transactions that read the kept switches, in order.

It refers to chips by their place in a harness.
"""

from typing import Annotated

from msgspec import Meta, Struct

SCHEMA = 1

Number = Annotated[int, Meta(ge=0, le=65535)]
# A bit of a reply, or a place among a stream's switches, and the number of its switch in the build.
Pair = tuple[Number, Number]
# A place among a stream's taxels, the code above which a level is closed, and the number of its switch in the build.
StreamLevel = tuple[Number, Number, Number]


class Port(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One transaction: the reading of this name of chip `chip` of bus `bus`, the I2C buses first, then SPI devices.

    switches holds (bit of the reply, number of the build's switch) pairs; with closed_high a bit of 1 is a closed
    switch, otherwise a bit of 0. A conversion, which reads one taxel, has `levels` instead: (code, number of the
    build's switch) pairs, closed above the code, codes ascending.
    """

    bus: Number
    chip: Number
    reading: Annotated[str, Meta(min_length=1)]
    switches: tuple[Pair, ...]
    closed_high: bool
    levels: tuple[Pair, ...] = ()

    @property
    def elements(self) -> tuple[int, ...]:
        """The numbers of the build's switches that it reads, levels included."""
        return tuple(number for _, number in (*self.switches, *self.levels))


class StreamRead(Struct, frozen=True, forbid_unknown_fields=True):
    """The used part of a stream: (place among its switches, number of the build's switch) pairs, and levels of its
    taxels by their places.
    """

    switches: tuple[Pair, ...]
    levels: tuple[StreamLevel, ...]


class ScanMap(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The reading plan of a glove, with its ports in reading order, and the used part of every stream."""

    schema: int
    ports: tuple[Port, ...]
    streams: tuple[StreamRead, ...] = ()

    @property
    def switches(self) -> tuple[int, ...]:
        """The numbers of the build's switches that are read: from the ports, then the streams."""
        streams = (pair[-1] for stream in self.streams for pair in (*stream.switches, *stream.levels))
        return (*(switch for port in self.ports for switch in port.elements), *streams)
