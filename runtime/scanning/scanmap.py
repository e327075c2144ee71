"""The scan map: the transactions that read the kept switches, in order; `scan.json` of a build.

It refers to chips by their place in a harness. Its bytes are canonical: fields in the order of the structs below,
indented by two, one newline at the end. `build.json` holds their SHA-256.
"""

from typing import Annotated

from msgspec import Meta, Struct

from ..errors import BuildError
from ..json_document import decode_document, encode_document
from ..names import fault, shortened

SCHEMA = 1
MAX_BYTES = 4 << 20

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


def scanmap_to_bytes(scan: ScanMap) -> bytes:
    """Return the content of `scan.json`."""
    return encode_document(scan)


def scanmap_from_bytes(data: bytes, what: str = "scan.json") -> ScanMap:
    """Return the scan map of a `scan.json`, whose name in messages is `what`.

    Raises BuildError if it is oversized, no such document, of another schema, not canonical, or reads an input twice.
    """
    scan = decode_document(data, ScanMap, what, "a scan map", MAX_BYTES, SCHEMA)
    if data != scanmap_to_bytes(scan):
        raise BuildError(f"{what} is altered: these are not the bytes that thenar writes; compile the build again")
    _check_once(scan, what)
    return scan


def check_switches(scan: ScanMap, switches: int) -> None:
    """Raise BuildError unless `scan` reads each of a build's `switches` once, and nothing else."""
    if sorted(scan.switches) != list(range(switches)):
        raise BuildError(f"scan.json does not read each of the {switches} kept switches once: compile the build again")


def _check_once(scan: ScanMap, what: str) -> None:
    for port in scan.ports:
        if reason := fault(port.reading):
            raise BuildError(f"{what}: the reading {shortened(repr(port.reading))} {reason}: compile the build again")
        if bool(port.switches) == bool(port.levels):
            raise BuildError(f"{what} has a port without switches, or with levels too: compile the build again")
    readings = [(port.bus, port.chip, port.reading) for port in scan.ports]
    if len(set(readings)) < len(readings):
        raise BuildError(f"{what} reads a port twice: compile the build again")
    sources = [pairs for port in scan.ports for pairs in (port.switches, port.levels)]
    sources += [stream.switches for stream in scan.streams]
    measured = [stream.levels for stream in scan.streams]
    levels = [[(taxel, code) for taxel, code, _ in each] for each in measured]
    for numbers in (scan.switches, *([bit for bit, _ in pairs] for pairs in sources), *levels):
        if len(set(numbers)) < len(numbers):
            raise BuildError(f"{what} reads a bit or a switch twice: compile the build again")
    for ascending in (*(port.levels for port in scan.ports), *measured):
        if list(ascending) != sorted(ascending):
            raise BuildError(f"{what} has levels out of order: compile the build again")
