"""A point of a frontier in words: in one line, and all that it costs and recognises."""

import shlex
from collections.abc import Iterable
from dataclasses import dataclass

from ..frontier.points import Point, Time
from ..text import DASH, counted, interval, microseconds


@dataclass(frozen=True, slots=True)
class Detail:
    """What is shown of a picked point: a sentence, names and values, its switches, and the command that builds it."""

    number: int
    said: str
    facts: tuple[tuple[str, str], ...]
    switches: tuple[str, ...]
    command: str


def point_words(point: Point) -> str:
    """Return a point in one line: "33 switches, elimination, 100 rounds, 8 bits, mcp23017 at 400 kHz"."""
    setting = point.setting
    inputs = {"both": " and joints", "switches": "", "joints": "joints alone"}[setting.inputs]
    switches = "" if setting.inputs == "joints" else counted(len(point.switches), "switch", "switches")
    rounds = counted(setting.rounds, "round")
    return ", ".join([f"{switches}{inputs}", setting.way.method, rounds, f"{setting.width} bits", _wiring(point)])


def _wiring(point: Point) -> str:
    setting = point.setting
    if not setting.clock_hz:
        return setting.wiring
    if setting.wiring == "board":
        return f"board at {setting.clock_hz:,} baud"
    return f"{setting.wiring} at {setting.clock_hz / 1000:g} kHz"


def point_detail(point: Point, source: str) -> Detail:
    """Return what is shown where the point, found on the recordings `source`, is picked."""
    said = f"Point {point.number}: {point_words(point)}; {interval(point.rate)} % in {microseconds(point.frame.us)} µs."
    command = f"thenar compile {shlex.quote(source)} -o build/ --from frontier/frontier.json --point {point.number}"
    return Detail(point.number, said, tuple(_facts(point)), point.switches, command)


def _facts(point: Point) -> Iterable[tuple[str, str]]:
    setting = point.setting
    yield "Recognition rate, %", interval(point.rate)
    yield "Subject left out, %", interval(point.left_out)
    yield "Placement", point_placement(point)
    yield "Inputs", f"{setting.inputs}, {counted(len(point.switches), 'switch', 'switches')}"
    yield "Wiring", f"{_wiring(point)}; {counted(point.ports, 'port')}, {counted(point.chips, 'chip')}"
    yield (
        "Tables",
        f"{counted(setting.rounds, 'round')}, {setting.width} bits" + (setting.layout and f"; {setting.layout}"),
    )
    ending = "ends early" if setting.scan == "early" else "full"
    yield "Scan", f"{_time(point.scan)}; {ending}" if point.switches else DASH
    yield "CyberGlove's record", DASH if setting.inputs == "switches" else _time(point.transfer)
    yield "Classify", _time(point.classify)
    yield "Frame", _time(point.frame)
    yield "Decision", setting.decision
    mean, late = point_latency(point)
    yield "Latency", DASH if mean == DASH else f"{mean} µs, 99th percentile {late} µs"
    yield "Grasps missed", f"{100 * point.latency.missed:.1f} %"
    yield "Flash and RAM", f"{point.flash:,} and {point.ram:,} bytes"
    yield "To compile", f"{point.compile_s:.1f} s"


def point_placement(point: Point) -> str:
    """Return by which method the point's switches were chosen, and its parameter; a dash where there are none."""
    way = point.setting.way
    return f"{way.method} {way.parameter:g}" if point.switches else DASH


def point_latency(point: Point) -> tuple[str, str]:
    """Return mean and 99th percentile of the latency, µs; dashes where no grasp was decided on rightly."""
    latency = point.latency
    return (DASH, DASH) if latency.missed >= 1 else (microseconds(latency.mean_us), microseconds(latency.p99_us))


def _time(time: Time) -> str:
    return f"{microseconds(time.us)} µs ({time.how})"
