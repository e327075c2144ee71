"""Boards whose wiring is known: pins, matrices with and without diodes, expanders behind a board."""

from typing import TYPE_CHECKING

import pytest

from thenar.compiler.glove.files import spec_files
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import BoardMatrix, BoardWiring, ChipWiring, Harness, StreamWiring

from .conftest import manifest_of, read_netlist

if TYPE_CHECKING:
    from .conftest import Netlist

NAMES = ("a", "b", "c")


def wired_by(board: BoardWiring) -> Harness:
    return Harness(name="h", streams=(StreamWiring(port="/dev/ttyACM0", switches=NAMES, board=board),))


def test_switches_on_pins_go_to_ground() -> None:
    board = BoardWiring(pins={"a": "2", "b": "3", "c": "A0"})
    netlist = read_netlist(spec_files(manifest_of(NAMES), None, wired_by(board))["glove.net"])
    for number, pin in enumerate(("2", "3", "A0"), start=1):
        assert netlist.net_of(f"SW{number}", "1") == netlist.net_of("A1", netlist.pin_of("A1", pin))
        assert netlist.net_of(f"SW{number}", "2") == "GND"


@pytest.mark.parametrize("diodes", [True, False])
def test_in_a_matrix_each_switch_joins_its_column_to_its_row(diodes: bool) -> None:
    matrix = BoardMatrix(rows=("2", "3"), columns=("8", "9"), keys=(("a", "b"), ("c", "")), diodes=diodes)
    netlist = read_netlist(spec_files(manifest_of(NAMES), None, wired_by(BoardWiring(matrix=matrix)))["glove.net"])
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
    files = spec_files(manifest_of(NAMES), None, harness)
    netlist = read_netlist(files["glove.net"])
    for number, (ref, pin) in enumerate((("U1", "GPA0"), ("U1", "GPB0"), ("A1", "4")), start=1):
        assert netlist.net_of(f"SW{number}", "1") == netlist.net_of(ref, netlist.pin_of(ref, pin))
    assert parse_harness(files["glove.toml"].decode(), "glove.toml") == harness
