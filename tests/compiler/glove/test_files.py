"""The files of a spec: which there are, that their bytes depend on nothing else, how boards are wired; any names."""

import csv
import io
import json
import subprocess
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.glove.files import NAMES, spec_files
from thenar.compiler.glove.propose import propose_board, propose_harness
from thenar.compiler.glove.spec import SpecSummary
from thenar.compiler.hand import HandShape
from thenar.compiler.text import text_of
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import BoardMatrix, BoardWiring, ChipWiring, GloveWiring, Harness, StreamWiring
from thenar.runtime.names import fault

from .conftest import manifest_of, read_netlist

ALWAYS = {"README.txt", "bom.csv", "glove.net", "glove.toml", "spec.json", "sensors.csv", "wiring.csv"}

DIGEST = """
import hashlib, sys
import msgspec
from thenar.simulator.handmaps.handmap import hand_map
from thenar.compiler.glove.files import spec_files
from thenar.runtime.manifest import Manifest
manifest = msgspec.json.decode(sys.stdin.buffer.read(), type=Manifest)
files = spec_files(manifest, hand=hand_map().fitted([switch.name for switch in manifest.switches]))
print(sorted((name, hashlib.sha256(data).hexdigest()) for name, data in files.items()))
"""


def rows(data: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(data.decode())))


def test_there_is_a_pattern_where_the_places_are_known(hand: HandShape) -> None:
    assert spec_files(manifest_of(hand.names[:5]), hand=hand).keys() == NAMES == ALWAYS | {"cutting.svg"}
    assert spec_files(manifest_of(["a"]), hand=hand).keys() == ALWAYS


def test_the_same_build_gives_the_same_bytes_in_any_process(hand: HandShape) -> None:
    asked = msgspec.json.encode(manifest_of(hand.names[:20]))
    told = {
        subprocess.run(
            [sys.executable, "-c", DIGEST],
            input=asked,
            capture_output=True,
            check=True,
            env={"PYTHONHASHSEED": seed, "TZ": zone},
        ).stdout
        for seed, zone in (("1", "UTC"), ("2", "Asia/Tokyo"))
    }
    assert len(told) == 1


def test_lists_summary_and_netlist_agree(hand: HandShape) -> None:
    files = spec_files(manifest_of(hand.names[:40]), hand=hand)
    summary = msgspec.json.decode(files["spec.json"], type=SpecSummary)
    switches, wires = rows(files["sensors.csv"]), rows(files["wiring.csv"])
    assert [row["name"] for row in switches] == list(hand.names[:40])
    assert len(wires) == len(summary.wires)
    ends = {row["sensors"]: (row["read_by"], row["input"]) for row in wires if row["read_by"]}
    assert {row["sensor"]: (row["read_by"], row["pin"]) for row in switches} == ends
    assert {row["contact"] for row in wires} == {"1", "2"}
    assert sum(float(row["quantity"]) for row in rows(files["bom.csv"])) > 40


def test_places_in_the_list_are_those_of_the_hand(hand: HandShape) -> None:
    for number, row in enumerate(rows(spec_files(manifest_of(hand.names), hand=hand)["sensors.csv"])):
        assert float(row["x_mm"]) == pytest.approx(hand.places[number, 0], abs=0.051)
        assert float(row["y_mm"]) == pytest.approx(hand.places[number, 1], abs=0.051)
        assert row["part"] == hand.part_names[hand.parts[number]]
        assert row["side"] == {-1: "left side", 0: "palm side", 1: "right side"}[int(hand.sides[number])]


def test_the_readme_says_what_to_expect(hand: HandShape) -> None:
    text = " ".join(spec_files(manifest_of(hand.names[:14]), hand=hand)["README.txt"].decode().split())
    assert (
        "A whole scan: 1 transaction, 121.3 µs on the wire, 100.0 % of the 121.3 µs for all 14 wired switches." in text
    )
    assert "Accuracy, new subject: 90.0 % [60.0, 98.0], 9 of 10 trials in 4 nested folds." in text
    assert "right hand of 190 mm length laid flat" in text
    assert "U1: mcp23017 at 0x20, 14 switches." in text


if TYPE_CHECKING:
    from .conftest import Netlist

ABC = ("a", "b", "c")


def wired_by(board: BoardWiring) -> Harness:
    return Harness(name="h", streams=(StreamWiring(port="/dev/ttyACM0", switches=ABC, board=board),))


def test_switches_on_pins_go_to_ground() -> None:
    board = BoardWiring(pins={"a": "2", "b": "3", "c": "A0"})
    netlist = read_netlist(spec_files(manifest_of(ABC), None, wired_by(board))["glove.net"])
    for number, pin in enumerate(("2", "3", "A0"), start=1):
        assert netlist.net_of(f"SW{number}", "1") == netlist.net_of("A1", netlist.pin_of("A1", pin))
        assert netlist.net_of(f"SW{number}", "2") == "GND"


@pytest.mark.parametrize("diodes", [True, False])
def test_in_a_matrix_each_switch_joins_its_column_to_its_row(diodes: bool) -> None:
    matrix = BoardMatrix(rows=("2", "3"), columns=("8", "9"), keys=(("a", "b"), ("c", "")), diodes=diodes)
    netlist = read_netlist(spec_files(manifest_of(ABC), None, wired_by(BoardWiring(matrix=matrix)))["glove.net"])
    for number, (column, row) in enumerate([("8", "2"), ("9", "2"), ("8", "3")], start=1):
        assert netlist.net_of(f"SW{number}", "2") == f"A1_{row}"
        assert column_of(netlist, number, diodes) == netlist.net_of("A1", netlist.pin_of("A1", column))
    assert sum(ref[0] == "D" for ref in netlist.components) == 3 * diodes
    nodes = [node for net in netlist.nets.values() for node in net]
    assert len(nodes) == len(set(nodes))


def column_of(netlist: "Netlist", switch: int, diodes: bool) -> str:
    """Return the net that a switch's contact 1 pulls down: through a diode from its anode, where there is one."""
    net = netlist.net_of(f"SW{switch}", "1")
    if not diodes:
        return net
    (diode,) = [ref for ref, _ in netlist.nets[net] if ref[0] == "D"]
    assert netlist.net_of(diode, netlist.pin_of(diode, "K")) == net
    return netlist.net_of(diode, netlist.pin_of(diode, "A"))


def test_the_host_reads_the_board_in_front_of_expanders() -> None:
    chip = ChipWiring(kind="mcp23017", address=0x21, pins={"GPA0": "a", "GPB0": "b"})
    harness = wired_by(BoardWiring(pins={"c": "4"}, chips=(chip,)))
    files = spec_files(manifest_of(ABC), None, harness)
    netlist = read_netlist(files["glove.net"])
    for number, (ref, pin) in enumerate((("U1", "GPA0"), ("U1", "GPB0"), ("A1", "4")), start=1):
        assert netlist.net_of(f"SW{number}", "1") == netlist.net_of(ref, netlist.pin_of(ref, pin))
    assert parse_harness(files["glove.toml"].decode(), "glove.toml") == harness


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
ANY_NAMES = (
    st.lists(st.sampled_from(PIECES) | st.text(max_size=3), min_size=1, max_size=20)
    .map("".join)
    .filter(lambda name: not fault(name))
)


@settings(deadline=None, max_examples=20)
@given(
    names=st.lists(ANY_NAMES, min_size=1, max_size=6, unique=True),
    glove=ANY_NAMES,
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
