"""`scan.json`: the scan map of a build that was compiled for a wiring, for report, spec and the faults of ports.

Its bytes are canonical: fields in the order of the structs of a scan map, indented by two, one newline at the end.
`build.json` holds their SHA-256.
"""

from pathlib import Path

from thenar.runtime.build import read_member
from thenar.runtime.errors import BuildError
from thenar.runtime.json_document import decode_document, encode_document
from thenar.runtime.manifest import Manifest
from thenar.runtime.names import fault, shortened
from thenar.runtime.scanning.scanmap import SCHEMA, ScanMap

SCAN_NAME = "scan.json"
MAX_BYTES = 4 << 20


def load_scan(folder: Path, manifest: Manifest) -> ScanMap | None:
    """Return the scan map of the build in `folder`; None if it was compiled for no harness. Raises BuildError."""
    if manifest.scan_sha256 is None:
        return None
    path = folder / SCAN_NAME
    scan = scanmap_from_bytes(read_member(path, MAX_BYTES, manifest.scan_sha256), str(path))
    switches = len(manifest.switches)
    if sorted(scan.switches) != list(range(switches)):
        raise BuildError(f"{path} does not read each of the {switches} kept switches once: compile the build again")
    return scan


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
