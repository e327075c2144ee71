"""Names of every kind that the one rule lets in, in all the files of a spec."""

import csv
import io
import json
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.glove.files import spec_files
from thenar.compiler.text import text_of
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import GloveWiring
from thenar.runtime.names import fault
from thenar.runtime.scanning.propose import propose_board, propose_harness

from .conftest import manifest_of, read_netlist

PIECES = [
    "=cmd|' /C calc'!A0",
    "@",
    "+",
    "-",
    "'",
    '"',
    "\\",
    ")",
    "(net",
    "[[bus]]",
    "#",
    "\u200d",
    ",",
    ";",
    "]]>",
    "é",
]
NAMES = (
    st.lists(st.sampled_from(PIECES) | st.text(max_size=3), min_size=1, max_size=20)
    .map("".join)
    .filter(lambda name: not fault(name))
)


@settings(deadline=None, max_examples=20)
@given(
    names=st.lists(NAMES, min_size=1, max_size=6, unique=True),
    glove=NAMES,
    wired=st.sampled_from([propose_board, propose_harness]),
)
def test_every_file_is_well_formed_and_gives_the_names_back(
    names: list[str], glove: str, wired: Callable[..., object]
) -> None:
    harness = wired(names, name=glove, cyberglove=GloveWiring(port="/dev/ttyUSB0"))
    files = spec_files(manifest_of(names), None, harness)  # type: ignore[arg-type]  # both return a Harness
    assert parse_harness(files["glove.toml"].decode(), "x") == harness
    assert json.loads(files["spec.json"])["glove"] == glove
    rows = list(csv.DictReader(io.StringIO(files["sensors.csv"].decode())))
    assert [text_of(row["name"]) for row in rows] == names
    for file in ("sensors.csv", "wiring.csv", "bom.csv"):
        cells = [cell for row in csv.reader(io.StringIO(files[file].decode())) for cell in row]
        assert not [cell for cell in cells if cell.startswith(("=", "+", "-", "@", "\t", "\r"))]
    components = read_netlist(files["glove.net"]).components
    assert {f"SW{number}" for number in range(1, len(names) + 1)} <= components.keys()
    for name in names:
        escaped = name.replace("\\", "\\\\").replace('"', '\\"')
        assert f'"{escaped}"' in files["glove.net"].decode()


def test_no_board_is_proposed_that_its_own_loader_would_refuse() -> None:
    assert len(propose_board([f"s{n}" for n in range(2000)]).switches) == 2000
    with pytest.raises(ValueError, match="2001 switches and taxels, but a row has at most 2000"):
        propose_board([f"s{n}" for n in range(2001)])
