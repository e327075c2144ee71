"""Boards that recognise by themselves: what their GRASP frames say is what the build answers."""

import hashlib
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.one_hand import for_one_hand
from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.scanner import BoardGrasp, BoardSegment, Scanner
from thenar.runtime.build import Build
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Options, Origin, Proof, Recognised, Switch
from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.tables import IntegerTables, tables_to_bytes

pytestmark = pytest.mark.slow

MOST_S = 20.0
# From a change until every GRASP is of it: records of the glove, a scan, and what a busy simulation is behind.
SETTLE_US = 150_000
BAUD = 1_000_000
PINS = ("D2", "D3", "D4", "D5", "D6", "D7", "B0", "B1", "B2", "B3", "B4", "B5")


def grasp_after(board: Scanner, time_us: int, *, wanted: bool = False) -> BoardGrasp:
    """Return the first that the board told after that moment; the first of a whole frame, if that is wanted."""
    end = monotonic() + MOST_S
    while monotonic() < end:
        board.read(0.1)
        told = board.grasp
        if told is not None and told.time_us >= time_us and not (wanted and told.degraded):
            return told
    raise AssertionError(f"no grasp after {time_us}; the last one: {board.grasp}, {board.counts}, {board.faults}")


def random_build(joints: int) -> Build:
    """Return one of 12 switches and so many joints, which are coded as a converter's upper 8 bits."""
    rng, classes, bins = np.random.default_rng(5), 5, 6

    def rows(*shape: int) -> np.ndarray:
        return rng.integers(-300, 301, shape).astype(np.int16)

    tables = IntegerTables(
        bias=rows(classes),
        switch_rows=rows(12, classes),
        thresholds=tuple(np.sort(rng.choice(255, bins - 1, replace=False)).astype(np.uint16) for _ in range(joints)),
        joint_rows=tuple(rows(bins, classes) for _ in range(joints)),
        switch_means=rows(12, classes),
        joint_means=rows(joints, classes),
        scale=100.0,
    )
    manifest = Manifest(
        schema=SCHEMA,
        checksum="",
        thenar="0.1.0",
        tables_sha256=hashlib.sha256(tables_to_bytes(tables)).hexdigest(),
        ensemble_sha256="0" * 64,
        source=Origin("1" * 64, 10, "own", 20, joints=22),
        options=Options(0, 100, "both", 1.0, 4, 1),
        grasps=tuple(f"grasp {number}" for number in range(classes)),
        switches=tuple(Switch(number, f"s{number}", 0.5) for number in range(12)),
        joints=tuple(Calibration(number, f"j{number}", "raw", 0, 0.0, 255, 255.0) for number in range(joints)),
        proof=Proof(16, tables.scale, tables.bound, 6.5, 13.0, 10, 0),
        rates=(Recognised("training", 0, 1, 10, 10),),
    )
    return Build(manifest, tables)


def answer_of(build: Build, bits: np.ndarray, codes: np.ndarray) -> tuple[int, int]:
    """Return grasp type and margin as the build gives them."""
    scores = np.array(build.scores(bits, codes), int)
    best = int(scores.argmax())
    return best, int(scores[best] - np.delete(scores, best).max())


def test_a_glove_with_a_cyberglove_tells_the_builds_answers_and_when_joints_are_missing(
    stage: Any, flash: Callable[..., Any], stack: ExitStack, tmp_path: Path
) -> None:
    truth = stage.truth("both")
    played = truth.performance
    build = for_one_hand(truth.build, played.calibration)
    places = [f"P{port}{bit}" for port in "ACFKL" for bit in range(8)]
    pins = "".join(f'{name} = "{pin}"\n' for name, pin in zip(truth.switch_names, places, strict=False))
    sensors = [sensor.name for sensor in played.calibration.sensors]
    text = f'part = "atmega2560"\n[pins]\n{pins}[cyberglove]\nsensors = {len(sensors)}\njoints = {sensors}\n'
    line = stack.enter_context(PtyLine(tmp_path / "cyberglove"))
    glove = stack.enter_context(EmulatedCyberGlove(line, sensors=len(sensors)))
    glove.set(played.sensors[0].tobytes())
    board = flash(build, parse_board(text), "glove", played.switch_names, f"join 1 115200 {line.link}")
    scanner = stack.enter_context(Scanner(str(tmp_path / "port"), BAUD))
    assert not grasp_after(scanner, 0, wanted=True).degraded  # the glove has been told to stream
    for row in range(len(played)):
        glove.set(played.sensors[row].tobytes())
        done = board.set_keys(played.switches[row].tolist())
        # A record that a busy computer is late with counts as missing.
        found = grasp_after(scanner, done.time_us + SETTLE_US, wanted=True)
        assert (found.number, found.margin) == answer_of(truth.build, truth.bits[row], truth.codes[row]), row
        assert not found.degraded
    line.unplug()
    gone_us = board.do("uart 1 off").time_us
    found = grasp_after(scanner, gone_us + SETTLE_US)
    no_joints = np.ones(len(truth.codes[row]), bool)
    without = truth.build.recognise(truth.bits[row], truth.codes[row], lost_joints=no_joints)
    assert (truth.build.grasps[found.number or 0], found.margin, found.degraded) == (
        without.grasp,
        without.margin,
        True,
    )
    line.replug()
    board.do("uart 1 on")
    found = grasp_after(scanner, found.time_us + 1, wanted=True)
    assert (found.number, found.degraded) == (answer_of(truth.build, truth.bits[row], truth.codes[row])[0], False)


def test_a_glove_with_chips_and_voltages_tells_the_builds_answers_and_which_chip_is_missing(
    flash: Callable[..., Any], stack: ExitStack, tmp_path: Path
) -> None:
    build, switches = random_build(joints=6), [f"s{number}" for number in range(12)]
    text = 'part = "atmega328p"\nscan_us = 5000\n'
    for kind, address, places, mine in (
        ("mcp23017", 0x20, [f"GPA{bit}" for bit in range(6)], switches[:6]),
        ("pca9555", 0x21, [f"P1{bit}" for bit in range(6)], switches[6:]),
    ):
        text += f'[[chip]]\nkind = "{kind}"\naddress = {address}\n[chip.pins]\n'
        text += "".join(f'{pin} = "{name}"\n' for pin, name in zip(places, mine, strict=True))
    # Channels 4 and 5 are the pins of the bus.
    channels = ("ADC0", "ADC1", "ADC2", "ADC3", "ADC6", "ADC7")
    text += "[analog]\n" + "".join(f'j{number} = "{channel}"\n' for number, channel in enumerate(channels))
    board = flash(build, parse_board(text), "glove", switches)
    scanner = stack.enter_context(Scanner(str(tmp_path / "port"), BAUD))
    rng = np.random.default_rng(4)
    for _ in range(25):
        bits, codes = rng.random(12) < 0.4, rng.integers(0, 256, 6).astype(np.uint16)
        for channel, code in zip(channels, codes, strict=True):
            board.do(f"volts {channel[-1]} {round((code + 0.5) * 5000 / 256)}")
        done = board.set_keys(bits.tolist())
        found = grasp_after(scanner, done.time_us + SETTLE_US, wanted=True)
        number, margin = answer_of(build, bits, codes)
        assert (found.number, found.margin) == (number, margin)
    found = grasp_after(scanner, board.do("unplug 0x21").time_us + SETTLE_US)
    without = build.recognise(bits, codes, lost_switches=np.arange(12) >= 6)
    assert (build.grasps[found.number or 0], found.margin, found.degraded) == (without.grasp, without.margin, True)
    found = grasp_after(scanner, board.do("replug 0x21").time_us, wanted=True)
    assert found.number == number


def told(board: Scanner, state: str, time_us: int) -> BoardSegment:
    """Return the first segment of this state that the board told after that moment."""
    end = monotonic() + MOST_S
    while monotonic() < end:
        board.read(0.05)
        segment = board.segment
        if segment is not None and segment.time_us >= time_us and segment.state == state:
            return segment
    raise AssertionError(f"no segment {state!r}; the last one: {board.segment}, {board.faults}")


@pytest.mark.parametrize("part", ["atmega328p", "atmega2560"])
def test_a_glove_tells_the_segments_that_the_build_finds(
    flash: Callable[..., Any], stack: ExitStack, tmp_path: Path, part: str
) -> None:
    """None held, a grasp that is held, let go, another: on the smallest part, too."""
    build, switches = random_build(joints=0), [f"s{number}" for number in range(12)]
    grasps = (*build.grasps[:-1], "none")
    model = SegmentModel.usual(len(grasps) - 1, True, build.tables.scale)
    build = Build(replace(build.manifest, grasps=grasps, segments=model), build.tables)
    rng = np.random.default_rng(6)
    rows = {answer_of(build, bits, np.empty(0))[0]: bits for bits in rng.random((400, 12)) < 0.4}
    pins = "".join(f'{name} = "P{port}"\n' for name, port in zip(switches, PINS, strict=True))
    board = flash(build, parse_board(f'part = "{part}"\n[pins]\n{pins}'), "glove", switches)
    scanner = stack.enter_context(Scanner(str(tmp_path / "port"), BAUD))
    assert scanner.hello is not None
    assert scanner.hello.has_segments
    none, now_us = len(grasps) - 1, board.set_keys(rows[len(grasps) - 1].tolist()).time_us
    assert told(scanner, "none", now_us + SETTLE_US).grasp is None
    for number, grasp in enumerate((2, 0, 2), 1):
        now_us = board.set_keys(rows[grasp].tolist()).time_us
        assert told(scanner, "forming", now_us)[1:3] == (number, grasp)
        held = told(scanner, "held", now_us)
        assert held[1:3] == (number, grasp)
        # The lag, three certain frames, and what a busy simulation is behind.
        assert held.time_us - now_us >= 150_000 - 2 * model.tick_us
        now_us = board.set_keys(rows[none].tolist()).time_us
        assert told(scanner, "releasing", now_us)[1:3] == (number, grasp)
        assert told(scanner, "none", now_us)[1:3] == (number, None)
