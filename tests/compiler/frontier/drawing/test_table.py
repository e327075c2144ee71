"""The CSV: what was found, to the last digit."""

import csv
import io
from typing import Any

import msgspec
import pytest

from thenar.compiler.frontier.drawing.table import COLUMNS, csv_bytes
from thenar.compiler.frontier.points import Frontier
from thenar.compiler.recordings.spreadsheet import text_of


def _rows(frontier: Frontier) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(csv_bytes(frontier).decode(), newline="")))


def _list(cell: str) -> tuple[str, ...]:
    (names,) = csv.reader([cell], delimiter=";")
    return tuple(names)


def test_what_is_read_again_are_the_points(examples: Any) -> None:
    frontier = examples.example_frontier()
    rows = _rows(frontier)
    assert len(rows) == len(frontier.points)
    for row, point in zip(rows, frontier.points, strict=True):
        way, setting = point.setting.way, point.setting
        assert tuple(row) == COLUMNS
        assert (int(row["number"]), int(row["n_switches"])) == (point.number, len(point.switches))
        assert (row["method"], float(row["parameter"])) == (way.method, way.parameter)
        for name in ("inputs", "layout", "wiring", "scan", "decision"):
            assert row[name] == getattr(setting, name)
        for name in ("rounds", "width", "clock_hz"):
            assert int(row[name]) == getattr(setting, name)
        for name in ("flash", "ram", "ports", "chips"):
            assert int(row[name]) == getattr(point, name)
        for name in ("scan", "transfer", "classify", "frame"):
            time = getattr(point, name)
            assert (float(row[f"{name}_us"]), row[f"{name}_how"]) == (time.us, time.how)
        for name in ("rate", "left_out"):
            rate = getattr(point, name)
            numbers = tuple(float(row[name + end]) for end in ("", "_low", "_high"))
            assert numbers == (rate.mean, rate.low, rate.high)
        latency = tuple(float(row[name]) for name in ("latency_mean_us", "latency_p99_us", "missed", "wrong"))
        assert latency == msgspec.structs.astuple(point.latency)
        assert float(row["compile_s"]) == point.compile_s
        assert _list(row["switches"]) == point.switches or not point.switches
        assert _list(row["fronts"]) == point.fronts


@pytest.mark.parametrize("name", ["a;b", 'say "so"', "comma, too", "=1+1", "ü"])
def test_names_come_back_as_they_are(examples: Any, name: str) -> None:
    points = examples.example_frontier().points
    named = msgspec.structs.replace(points[0], switches=(name, "s2"))
    (row,) = _rows(examples.example_frontier(points=(named,), picked=None))
    (names,) = csv.reader(io.StringIO(text_of(row["switches"]), newline=""), delimiter=";")
    assert names == [name, "s2"]
    assert not row["switches"].startswith("=")


def test_one_subject_has_no_rate_of_those_left_out(examples: Any) -> None:
    points = examples.example_frontier().points
    (row,) = _rows(examples.example_frontier(points=(msgspec.structs.replace(points[0], left_out=None),), picked=None))
    assert (row["left_out"], row["left_out_low"], row["left_out_high"]) == ("", "", "")


def test_equal_frontiers_give_equal_bytes(examples: Any) -> None:
    assert csv_bytes(examples.example_frontier()) == csv_bytes(examples.example_frontier())
