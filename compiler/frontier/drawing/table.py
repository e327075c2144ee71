"""The frontier's points as CSV, a row each, numbers as exact as they were found."""

import csv
import io
from collections.abc import Iterable, Iterator

from ...recordings.spreadsheet import cells
from ..points import Frontier, Point, Rate, Time

COLUMNS = (
    *("number", "fronts", "n_switches", "inputs", "method", "parameter", "rounds", "width", "layout"),
    *("wiring", "clock_hz", "scan", "decision", "rate", "rate_low", "rate_high"),
    *("left_out", "left_out_low", "left_out_high", "scan_us", "scan_how", "transfer_us", "transfer_how"),
    *("classify_us", "classify_how", "frame_us", "frame_how", "latency_mean_us", "latency_p99_us", "missed", "wrong"),
    *("flash", "ram", "ports", "chips", "compile_s", "switches"),
)


def csv_bytes(frontier: Frontier) -> bytes:
    """Return `frontier.csv`: UTF-8, a line of COLUMNS, a line for each point.

    Rates are in 0..1, times in microseconds (compile_s: seconds), a missing `left_out` is empty. `fronts` and
    `switches` are lists in their cell, parted by semicolons; what holds a semicolon or a quote is quoted as CSV quotes.
    """
    file = io.StringIO(newline="")
    rows = csv.writer(file, lineterminator="\n")
    rows.writerow(COLUMNS)
    rows.writerows(cells(_values(point)) for point in frontier.points)
    return file.getvalue().encode()


def _values(point: Point) -> Iterator[object]:
    setting, latency = point.setting, point.latency
    yield from (point.number, _list(point.fronts), len(point.switches), setting.inputs)
    yield from (setting.way.method, setting.way.parameter, setting.rounds, setting.width, setting.layout)
    yield from (setting.wiring, setting.clock_hz, setting.scan, setting.decision)
    yield from (*_rate(point.rate), *_rate(point.left_out))
    for time in (point.scan, point.transfer, point.classify, point.frame):
        yield from _time(time)
    yield from (latency.mean_us, latency.p99_us, latency.missed, latency.wrong)
    yield from (point.flash, point.ram, point.ports, point.chips, point.compile_s, _list(point.switches))


def _rate(rate: Rate | None) -> tuple[object, ...]:
    return ("", "", "") if rate is None else (rate.mean, rate.low, rate.high)


def _time(time: Time) -> tuple[object, ...]:
    return time.us, time.how


def _list(names: Iterable[str]) -> str:
    listed = io.StringIO(newline="")
    csv.writer(listed, delimiter=";", lineterminator="").writerow(names)
    return listed.getvalue()
