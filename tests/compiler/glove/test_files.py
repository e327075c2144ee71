"""The files of a spec: which there are, that their bytes depend on nothing else, and that the lists agree."""

import csv
import io
import subprocess
import sys

import msgspec
import pytest

from thenar.compiler.glove.files import NAMES, spec_files
from thenar.compiler.glove.spec import SpecSummary
from thenar.compiler.hand import HandShape

from .conftest import manifest_of

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
    assert spec_files(manifest_of(hand.names[:5]), hand=hand).keys() == NAMES == ALWAYS | {"cutting.svg", "cutting.dxf"}
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
        "A whole scan: 1 transaction, 121.3 us on the wire, 100.0 % of the 121.3 us for all 14 wired switches." in text
    )
    assert "Accuracy, new subject: 90.0 % [60.0, 98.0], 9 of 10 trials in 4 nested folds." in text
    assert "right hand of 190 mm length laid flat" in text
    assert "U1: mcp23017 at 0x20, 14 switches." in text
