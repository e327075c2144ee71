"""The sentence that sums a frontier up, names, and the CSV: what was found, to the last digit."""

import csv
import io
from typing import Any

import msgspec
import pytest

from thenar.compiler.frontier.points import Frontier
from thenar.compiler.frontier.words import csv_bytes, featured, rates_of, summary, training_of, wiring_of
from thenar.compiler.text import text_of


def test_the_summary_gives_switches_time_accuracy_and_reference_points(examples: Any) -> None:
    marks = examples.example_frontier().marks
    assert summary(examples.example_frontier(marks=(marks[0], marks[2]))) == (
        "Point 5: 33 of 160 switches, read and classified in 440 µs on ATmega328P at 16 MHz, reach 92.9 [92.1, 93.7] % "
        "accuracy (new subject, trials), against 93.6 % in 2.05 ms with all 160 switches and 91.5 % in 905 µs with 35 "
        "switches (paper, S = 62). Cross-validation gave 93.3 %; 0.4 points are subtracted, because the best of many "
        "is picked by its luck, too."
    )


def test_rates_are_named_by_what_they_are_of_and_their_unit(examples: Any) -> None:
    frontier = examples.example_frontier()
    assert list(rates_of(frontier)) == ["new subject", "pooled"]
    point = msgspec.structs.replace(frontier.points[0], frames=frontier.points[1].rate)
    several = rates_of(examples.example_frontier(points=(point,), picked=None))
    assert list(several) == ["new subject", "new subject, frames", "pooled"]
    assert [rate(point) for rate in several.values()] == [point.rate, point.frames, point.other_rate]
    assert list(rates_of(examples.example_frontier(subjects=1, by="pooled"))) == ["pooled"]


def test_without_marks_and_without_points_it_is_still_a_summary(examples: Any) -> None:
    assert summary(examples.example_frontier(marks=())).endswith("by its luck, too.")
    none = examples.example_frontier(points=(), picked=None)
    assert summary(none) == "Of 184,320 combinations none is a point of the frontier."


def test_without_a_pick_the_fastest_equivalent_point_is_featured(examples: Any) -> None:
    frontier = examples.example_frontier(picked=None)
    point = featured(frontier)
    assert point is not None
    assert point.number == 6
    assert all(other.rate.mean < 0.931 for other in frontier.points if other.frame.us < point.frame.us)


def test_where_no_point_is_level_the_best_is_spoken_of(examples: Any) -> None:
    best = featured(examples.example_frontier(picked=None, marks=()))
    assert best is not None
    assert best.number == 10


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, "20 rounds"),
        ({"settings": {"shrinkage": 0.5}}, "20 rounds, shrinkage 0.5"),
        ({"trainer": "logit", "rounds": None, "settings": {"joint_bins": 5.0}}, "logit, joint-bins 5"),
    ],
)
def test_a_trainer_is_named_where_it_is_not_the_papers(examples: Any, changes: dict[str, Any], said: str) -> None:
    point = examples.example_frontier().points[0]
    setting = msgspec.structs.replace(point.setting, **changes)
    assert training_of(setting) == said
    written = msgspec.json.decode(msgspec.json.encode(setting))
    assert {"trainer", "settings"} & set(written) == {"trainer", "settings"} & set(changes)
    table = csv_bytes(examples.example_frontier(points=(msgspec.structs.replace(point, setting=setting),), picked=None))
    assert table.split(b"\n")[0].endswith(b",trainer,settings" if changes else b",switches,joints")


@pytest.mark.parametrize(
    ("wiring", "clock", "said"),
    [
        ("mcp23017", 400_000, "mcp23017 400 kHz"),
        ("board", 1_000_000, "board 1 Mbaud"),
        ("board", 115_200, "board 115.2 kbaud"),
        ("as wired", 0, ""),
    ],
)
def test_a_wiring_is_told_with_its_clock(examples: Any, wiring: str, clock: int, said: str) -> None:
    setting = examples.example_frontier().points[0].setting
    assert wiring_of(msgspec.structs.replace(setting, wiring=wiring, clock_hz=clock)) == said


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
        way, setting = point.setting.placement, point.setting
        assert (int(row["number"]), int(row["n_switches"])) == (point.number, len(point.switches))
        assert (row["method"], float(row["parameter"])) == (way.method, way.parameter)
        for name in ("inputs", "wiring"):
            assert row[name] == getattr(setting, name)
        for name in ("rounds", "width", "clock_hz"):
            assert int(row[name]) == getattr(setting, name)
        for name in ("flash", "ram", "ports", "chips"):
            assert int(row[name]) == getattr(point, name)
        for name in ("scan", "transfer", "classify", "frame"):
            time = getattr(point, name)
            assert (float(row[f"{name}_us"]), row[f"{name}_how"]) == (time.us, time.how)
        for name in ("rate", "other_rate"):
            rate = getattr(point, name)
            numbers = tuple(float(row[name + end]) for end in ("", "_low", "_high"))
            assert (row[f"{name}_of"], *numbers) == (rate.what, rate.mean, rate.low, rate.high)
        assert (float(row["luck"]), row["frames"]) == (point.luck, "")
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
