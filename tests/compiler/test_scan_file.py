import contextlib
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.scan_file import MAX_BYTES, scanmap_from_bytes, scanmap_to_bytes
from thenar.runtime.errors import BuildError
from thenar.runtime.scanning.scanmap import SCHEMA, Port, ScanMap, StreamRead

SCAN = ScanMap(
    SCHEMA,
    (Port(0, 1, "AB", ((0, 2), (9, 0)), False), Port(0, 0, "A", ((3, 4),), True)),
    (StreamRead(((0, 1), (5, 3)), ()), StreamRead((), ())),
)


def test_a_map_is_read_as_it_was_written() -> None:
    data = scanmap_to_bytes(SCAN)
    assert data.endswith(b"}\n")
    assert scanmap_from_bytes(data) == SCAN
    assert SCAN.switches == (2, 0, 4, 1, 3)


def changed(**fields: Any) -> bytes:
    document = json.loads(scanmap_to_bytes(SCAN))
    return json.dumps(document | fields, indent=2).encode() + b"\n"


PORT = {"bus": 0, "chip": 1, "reading": "AB", "switches": [[0, 2]], "closed_high": False}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "is not a build's"),
        (b"[]", "is not a build's"),
        (b"[" * 2000, "is not a build's"),
        (b"\xff\xfe", "is not a build's"),
        (changed(schema=2), "has schema 2, this thenar reads 1: compile the build again"),
        (changed(schema=0), "has schema 0, this thenar reads 1"),
        (changed(more=1), "unknown field `more`"),
        (changed(ports=[PORT | {"bus": -1}]), "is not a build's: .*bus"),
        (changed(ports=[PORT | {"reading": "a\0b"}]), "holds a control character"),
        (changed(ports=[PORT | {"reading": "9" * 5000}]), "has 5000 characters: at most 200"),
        (changed(ports=[PORT | {"switches": []}]), "has a port without switches, or with levels too"),
        (changed(ports=[PORT | {"levels": [[7, 3]]}]), "has a port without switches, or with levels too"),
        (changed(streams=[{"switches": [], "levels": [[0, 8, 5], [0, 7, 6]]}]), "has levels out of order"),
        (changed(streams=[{"switches": [], "levels": [[0, 7, 5], [0, 7, 6]]}]), "twice: compile the build again"),
        (changed(ports=[PORT | {"closed_high": 1}]), "is not a build's: .*closed_high"),
        (scanmap_to_bytes(SCAN) + b"\n", "is altered"),
        (json.dumps(json.loads(scanmap_to_bytes(SCAN))).encode(), "is altered"),
        (b" " * (MAX_BYTES + 1), f"has {MAX_BYTES + 1} bytes, a scan map has at most"),
    ],
)
def test_what_is_no_map_is_refused_by_name(data: bytes, reason: str) -> None:
    with pytest.raises(BuildError, match=rf"^here\.json:? .*{reason}"):
        scanmap_from_bytes(data, "here.json")


@pytest.mark.parametrize(
    "scan",
    [
        ScanMap(1, (Port(0, 0, "A", ((0, 0),), False), Port(0, 0, "A", ((1, 1),), False))),
        ScanMap(1, (Port(0, 0, "A", ((0, 0), (0, 1)), False),)),
        ScanMap(1, (Port(0, 0, "A", ((0, 0), (1, 0)), False),)),
        ScanMap(1, (Port(0, 0, "A", ((0, 0),), False),), (StreamRead(((3, 0),), ()),)),
        ScanMap(1, (), (StreamRead(((3, 0), (3, 1)), ()),)),
    ],
)
def test_a_map_that_reads_a_thing_twice_is_refused(scan: ScanMap) -> None:
    with pytest.raises(BuildError, match="twice: compile the build again"):
        scanmap_from_bytes(scanmap_to_bytes(scan))


@given(position=st.integers(0, len(scanmap_to_bytes(SCAN)) - 1), value=st.integers(0, 255))
def test_a_damaged_map_raises_nothing_but_our_own_errors(position: int, value: int) -> None:
    data = bytearray(scanmap_to_bytes(SCAN))
    data[position] = value
    if bytes(data) != scanmap_to_bytes(SCAN):
        with contextlib.suppress(BuildError):
            # Another number of a bit is a map, too: only build.json's checksum knows better.
            assert scanmap_from_bytes(bytes(data)) != SCAN
