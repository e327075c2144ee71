"""Rows of numbers, over any transport, as frames: `[[stream]]` says which column is a switch, a joint or a taxel."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from thenar.drivers.lines import CLOCK_US, SEQUENCES, UNITS_US, Row, RowReader
from thenar.drivers.senders import SILENCE_US
from thenar.drivers.transports import OTHER_PORTS

from ..frames import PERIODS, GloveFrame, Mask, SwitchFrame, now_us
from ..harness.wiring import Harness, Range, StreamWiring
from ..names import list_names, shortened
from ..published import Count
from ..scanning.scanmap import ScanMap
from ..taxels import Level, LiveTaxel, TaxelCalibration
from .base import SHORTEST_US, Source, SourceKind, counted, debouncer_of

# Codes of joints are bytes, as a CyberGlove's; 0 is a joint without a value. A taxel's whole numbers are its codes;
# closer numbers are coded in this many steps.
JOINT_CODES = (1, 255)
_TAXEL_STEPS, _FEWEST_STEPS, _MOST_STEPS = 4095, 255, 65_534
# A clock that goes back further, or ahead of ours by more, has restarted, or is another sender's.
_BACK_US, _AHEAD_US = 1_000_000, 10_000_000
# Boards count milliseconds and microseconds in 32 bits. Above the limit, a float has no whole microseconds.
_TURN_US, _LATEST_US = {"s": math.inf, "ms": 2.0**32 * 1e3, "us": 2.0**32}, 2.0**53
# The fastest row of this many periods, twice as many at most, sets a sender's clock against ours. Resonators of boards
# are off by half a percent: over more rows that error alone would make new rows late.
_WINDOW = 10
# A shorter break between rows is not counted: serial adapters and radios deliver rows in bunches.
_BUNCH_US = 50_000
_SLOW, _FAST = 0.75, 1.5
# Within this share of the rate that was said last, it is the same.
_WAVERS = 0.1
# What is wrong with a sender that is connected is reported after this time without a row, or since it was noticed.
_NOTICE_US = 2_000_000
_SILENT = f"connected, but no row has come for {_NOTICE_US / 1e6:g} s or longer: is its program running?"
_NO_TIME = "leave out `time` in glove.toml"
# A serial adapter, or a radio, may hold a row back for this long in normal operation.
_WAY_US = 20_000
# By their counts, rows whose clock is wrong.
_WRONG = {
    "untimed": "rows come whose clock is missing, or no time, and are left out",
    "late": "rows come after later ones and are left out: do two programs send?",
    "jumped": "rows of another clock come and are left out: do two programs send?",
    "restarts": "its clock has restarted: was the board reset, or does another program send?",
}


class SenderClock:
    """Converts a sender's time stamps to this computer's time: no later than the row came, and by the fastest of the
    last rows, which come every `period_us`. The sender's clock begins again after `turn_us`.
    """

    def __init__(self, period_us: int, turn_us: float = math.inf) -> None:
        self._window_us, self._turn_us = _WINDOW * period_us, turn_us
        self.last_us: float | None = None
        self._came_us = self._shown_us = self._until_us = 0
        self._offsets = [0.0, 0.0]

    def host_us(self, sent_us: float, came_us: int) -> int | str:
        """Return the time of a row that its sender stamped `sent_us`.

        "late" if it comes after a later one, "jumped" if it has another clock than the rows that still come, "restarts"
        if the sender's clock has restarted, and this clock with it.
        """
        last = self.last_us
        if last is not None:
            step, longest_us = sent_us - last, came_us - self._came_us + _AHEAD_US
            if -_BACK_US < step < 0:
                return "late"
            if 0 <= step + self._turn_us <= longest_us:
                self._offsets = [offset + self._turn_us for offset in self._offsets]
            elif not 0 <= step <= longest_us:
                if came_us - self._came_us < SILENCE_US:
                    return "jumped"
                self.last_us = None
                return "restarts"
        offset = came_us - sent_us
        if last is None or came_us > self._until_us:
            self._offsets = [offset, offset if last is None else self._offsets[0]]
            self._until_us = came_us + self._window_us
        self._offsets[0] = min(self._offsets[0], offset)
        self.last_us, self._came_us = sent_us, came_us
        self._shown_us = max(self._shown_us, min(came_us, round(sent_us + min(self._offsets))))
        return self._shown_us


@dataclass(slots=True)
class RowCounts:
    """Counts of a sender's rows, since the source was made.

    wrong_columns  rows without the columns that are needed, or of another number of them
    missing        values of needed columns that were not there, or not numbers
    out_of_range   values beyond the range in glove.toml, clipped to it
    repeated       rows that came twice
    untimed        rows whose clock was not there, not finite, or beyond all dates, and were left out
    late           rows that came after a later one, and were left out
    jumped         rows of another clock than the one that was running, and were left out
    restarts       restarts of the sender's clock
    gaps, lost     breaks between two rows, and the rows that are missing there
    """

    rows: int = 0
    wrong_columns: int = 0
    missing: int = 0
    out_of_range: int = 0
    repeated: int = 0
    untimed: int = 0
    late: int = 0
    jumped: int = 0
    restarts: int = 0
    gaps: int = 0
    lost: int = 0


@dataclass(slots=True)
class RowWatch:
    """The arrival of rows: gaps, by the numbers of rows or else by the sender's clock if there is one, and the rate.

    hz         rows a second over the last second or longer; None: not known yet
    steady_hz  the lower of the last two such rates: rows that had been waiting for this program come all at once
    """

    period_us: int
    counts: RowCounts = field(default_factory=RowCounts)
    hz: float | None = None
    steady_hz: float = 0.0
    _last_us: float | None = None
    _last: int | None = None
    _stamped: bool = False
    _since_us: int | None = None
    _rows: int = 0

    def begin(self) -> None:
        """Start afresh, after a break that is not a gap between rows."""
        self._last_us = self._last = self._since_us = None

    def row(self, came_us: int, sent_us: float | None, sequence: int | None = None) -> None:
        """Take a row that counts."""
        self.counts.rows += 1
        lost = self._lost(came_us, sent_us) if sequence is None else self._skipped(sequence)
        if lost is not None:
            self.counts.gaps += 1
            self.counts.lost += lost
        if self._since_us is None:
            self._since_us, self._rows = came_us, 0
            return
        self._rows += 1
        if came_us - self._since_us >= max(1_000_000, 4 * self.period_us):
            hz = self._rows * 1e6 / (came_us - self._since_us)
            self.hz, self.steady_hz = hz, min(hz, self.hz or 0.0)
            self._since_us, self._rows = came_us, 0

    def _skipped(self, sequence: int) -> int | None:
        """Return how many numbers are missing before this one, None if none is."""
        last, self._last = self._last, sequence
        return None if last is None else (sequence - last - 1) % SEQUENCES or None

    def _lost(self, came_us: int, sent_us: float | None) -> int | None:
        """Return how many rows are missing by the time of this one, None if there is no gap before it."""
        if self._stamped != (sent_us is not None):  # times of two clocks have no gap between them
            self._last_us, self._stamped = None, sent_us is not None
        time_us = came_us if sent_us is None else sent_us
        longest_us = 1.5 * self.period_us if sent_us is not None else max(2 * self.period_us, _BUNCH_US)
        last_us, self._last_us = self._last_us, time_us
        if last_us is None or time_us - last_us <= longest_us:
            return None
        return max(round((time_us - last_us) / self.period_us) - 1, 0)


class Columns:
    """Finds the used columns by the names that rows have, or by the order in glove.toml in rows without names.

    needed  those of the used columns that rows must have; replace it before the first row
    found   the columns of the last row that is not from this glove; None: there was none
    absent  the needed columns that the last row with names lacks
    """

    def __init__(self, wanted: Sequence[str], columns: Sequence[str], time: str | None) -> None:
        self._wanted, self._columns, self._time = tuple(wanted), tuple(columns), time
        self.needed = frozenset(wanted)
        self._names: tuple[str, ...] | None = None
        self._places: tuple[int | None, ...] | None = None
        self.found: tuple[str, ...] | None = None
        self.absent: tuple[str, ...] = ()

    def of(self, row: Row) -> tuple[float | None, ...] | None:
        """Return the values of the wanted columns, None for a missing one; None for a row of other columns."""
        if self._places is None or row.names != self._names:
            self._names, self._places = row.names, self._placed(row.names)
        if self._places is not None and (row.names is not None or len(row.values) == len(self._columns)):
            return tuple([None if place is None else row.values[place] for place in self._places])
        self.found = row.names or tuple(f"column {number + 1}" for number in range(len(row.values)))
        return None

    def missing(self, values: Sequence[float | None]) -> int:
        """Return how many of these values of the wanted columns are needed, and None."""
        return sum(value is None and name in self.needed for name, value in zip(self._wanted, values, strict=True))

    def _placed(self, names: tuple[str, ...] | None) -> tuple[int | None, ...] | None:
        order = self._columns if names is None else names
        places = {name: place for place, name in enumerate(order) if name}
        absent = tuple(name for name in self._wanted if name in self.needed and name not in places)
        # A row that lacks a sensor counts; one that lacks its clock, or most needed columns, is not from this glove.
        if 2 * len(absent) > len(self.needed) or (self._time is not None and self._time not in places):
            return None
        self.absent = absent
        return tuple(places.get(name) for name in self._wanted)


class RowSource(Source):
    """Stream number `number` of a harness: switches as in `scan`, all joints, all taxels.

    Its rows must have the switches of `scan`, the taxels with levels in it, and the joints that `read_only` names.
    Without that call, which comes for a build, they must have all joints, and without levels all taxels.
    """

    def __init__(
        self,
        reader: RowReader,
        harness: Harness,
        number: int,
        scan: ScanMap,
        taxels: TaxelCalibration | None = None,
    ) -> None:
        wiring, read = harness.streams[number], scan.streams[number]
        self.name = f"stream from {wiring.port}"
        self.reader, self.wiring = reader, wiring
        # With the transport of a row on a good line.
        self.period_us = max(SHORTEST_US, wiring.period_us) + _WAY_US // PERIODS
        self.longest_us = PERIODS * self.period_us
        wanted = (*wiring.used, *([] if wiring.time is None else [wiring.time]))
        self._columns = Columns(wanted, wiring.columns, wiring.time)
        self._read = frozenset(wiring.switches[place] for place, _ in read.switches)
        low = wiring.closed == "low"
        self._switches = [
            (place, wiring.thresholds.get(wiring.switches[place], wiring.threshold), low, 1 << switch)
            for place, switch in read.switches
        ]
        first = len(wiring.switches)
        self._joints = [_Grid(limits, *JOINT_CODES) for limits in wiring.joints.values()]
        self._first_joint, self._first_taxel = first, first + len(self._joints)
        self._grids = [_Grid(limits, 0, steps_of(limits)) for limits in wiring.taxels.values()]
        self._taxel_names, self._everything = tuple(wiring.taxels), harness.taxel_names
        self._places = [self._everything.index(name) for name in self._taxel_names]
        levels: dict[int, list[Level]] = {}
        for place, limit, switch in read.levels:
            levels.setdefault(place, []).append((limit, switch))
        self._calibration, self.reads_joints = taxels, bool(wiring.joints)
        self._levels = [levels.get(place, []) for place in range(len(self._taxel_names))]
        self.owned: Mask = sum(bit for *_, bit in self._switches)
        self.owned |= sum(1 << switch for each in self._levels for _, switch in each)
        self._measured = frozenset(self._taxel_names[place] for place in levels)
        self._need(wiring.joints, self._measured or wiring.taxels)
        self._sends_switches = bool(self.owned or self._taxel_names)
        self._debounce = harness.debounce
        self.watch = RowWatch(wiring.period_us)
        self._ready = deque[SwitchFrame | GloveFrame]()
        # Of the last row that counts: how many rows and lines had not counted before it, and bytes received.
        self._before = (0, 0, 0)
        self._begin()

    def _begin(self) -> None:
        turn_us = CLOCK_US if self.wiring.time is None else _TURN_US[self.wiring.time_unit]
        self._clock = SenderClock(self.wiring.period_us, turn_us)
        # When a row came last; when the sender's clock changed last.
        self._came_us = self._ticked_us = now_us()
        # A fault of single rows, and until when it is reported.
        self._fault, self._fault_until_us = "", -1
        self._told_hz = 0.0
        self._last: tuple[float, Sequence[float | None]] | None = None
        self._ready.clear()
        self.watch.begin()
        self._debouncer = debouncer_of(self._debounce)
        self.taxels = [
            LiveTaxel(name, levels, self._calibration, grid.last)
            for name, levels, grid in zip(self._taxel_names, self._levels, self._grids, strict=True)
        ]

    def _need(self, joints: Iterable[str], taxels: Iterable[str]) -> None:
        time = () if self.wiring.time is None else (self.wiring.time,)
        self._columns.needed = self._read.union(joints, taxels, time)

    @property
    def wire_us(self) -> float:
        """The time from row to row, as wired."""
        return self.wiring.period_us

    def read_only(self, sensors: Sequence[str]) -> None:
        """Accept rows that lack other joints than these, and taxels without levels."""
        self._need([name for name in self.wiring.joints if name in sensors], self._measured)

    def open(self) -> None:
        """Open the reader."""
        self.reader.open()
        self._begin()

    def read(self, timeout_s: float) -> SwitchFrame | GloveFrame | None:
        """Return the next frame; a row with joints and switches makes two."""
        if not self._ready:
            rows = self.reader.read(timeout_s)
            read_us = now_us()
            for row in rows:
                self.take(row, read_us if row.came_us is None else row.came_us)
        return self._ready.popleft() if self._ready else None

    def take(self, row: Row, came_us: int) -> None:
        """Take a row that came at this time: its frames are then ready."""
        values, counts = self._columns.of(row), self.watch.counts
        if values is None:
            counts.wrong_columns += 1
            return
        self._came_us, self._before = came_us, self._uncounted()
        sent_us, time_us = self._sent_us(row, values), came_us
        if sent_us is not None:
            known_us = self._known_us(sent_us, came_us, values)
            if known_us is None:
                return
            time_us, self._last = known_us, (sent_us, values)
        counts.missing += self._columns.missing(values)
        self.watch.row(came_us, sent_us, row.sequence)
        self._make_frames(time_us, values)

    def _sent_us(self, row: Row, values: Sequence[float | None]) -> float | None:
        """Return the sender's time of a row, which may be anything; None: it has no clock."""
        if self.wiring.time is not None:
            return math.nan if values[-1] is None else values[-1] * UNITS_US[self.wiring.time_unit]
        return None if row.time_s is None else row.time_s * 1e6

    def _known_us(self, sent_us: float, came_us: int, values: Sequence[float | None]) -> int | None:
        """Return our time of a row by its sender's clock; None if the row does not count, which is counted."""
        if not abs(sent_us) <= _LATEST_US:  # nan, too
            self._wrong(came_us, "untimed")
            return None
        if sent_us != self._clock.last_us:
            self._ticked_us = came_us
        elif came_us - self._ticked_us > self.longest_us:
            self._report(came_us, "its clock does not change from row to row, so rows count as old: " + _NO_TIME)
        if (sent_us, values) == self._last:
            self.watch.counts.repeated += 1
            return None
        found = self._clock.host_us(sent_us, came_us)
        if found == "restarts":
            self._wrong(came_us, found)
            self.watch.begin()
            found = self._clock.host_us(sent_us, came_us)
        if isinstance(found, int):
            return found
        self._wrong(came_us, found)
        return None

    def _wrong(self, came_us: int, what: str) -> None:
        """Count a row whose clock is wrong, and report that."""
        setattr(self.watch.counts, what, getattr(self.watch.counts, what) + 1)
        self._report(came_us, _WRONG[what])

    def _report(self, came_us: int, fault: str) -> None:
        self._fault, self._fault_until_us = fault, came_us + _NOTICE_US

    def _make_frames(self, time_us: int, values: Sequence[float | None]) -> None:
        joints = values[self._first_joint : self._first_taxel]
        glove = None
        if any(value is not None for value in joints):
            codes = (self._code(grid, value) or 0 for grid, value in zip(self._joints, joints, strict=True))
            glove = GloveFrame(time_us, bytes(codes))
        if self._sends_switches:
            self._ready.append(self._switch_frame(time_us, values, glove))
        if glove is not None:
            self._ready.append(glove)

    def _switch_frame(self, time_us: int, values: Sequence[float | None], glove: GloveFrame | None) -> SwitchFrame:
        """Return the switches and taxels of a row, and its joints: they are never combined with another row's."""
        closed = known = 0
        for place, threshold, low, bit in self._switches:
            if (value := values[place]) is not None:
                known |= bit
                closed |= bit if (value > threshold) != low else 0
        row: list[int | None] = [None] * len(self._everything)
        measured = values[self._first_taxel : self._first_taxel + len(self._grids)]
        for taxel, grid, place, value in zip(self.taxels, self._grids, self._places, measured, strict=True):
            row[place] = code = self._code(grid, value)
            pressed, lost = taxel.read(code)
            closed, known = closed | pressed, known | taxel.owned & ~lost
        if self._debouncer is not None:
            closed = self._debouncer.update(time_us, closed, known) & known
        return SwitchFrame(time_us, closed, self.owned & ~known, glove, tuple(row) if self._grids else None)

    def _code(self, grid: "_Grid", value: float | None) -> int | None:
        if value is None:
            return None
        code = grid.code(value)
        held = min(max(code, grid.first), grid.last)
        self.watch.counts.out_of_range += held != code
        return held

    def counts(self) -> tuple[Count, ...]:
        """Return the rate of rows, and counts of their faults."""
        rate = Count("rows a second", 0 if self._silent else round(self.watch.hz or 0))
        return (rate, *counted(self.watch.counts), *counted(self.reader.counts()))

    def fault_message(self) -> str:
        """Return the fault of arriving rows or lines; "" if there is none."""
        # Compared with the counts at the last row: what came since.
        wrong, misfits, received = map(int.__sub__, self._uncounted(), self._before)
        if other := self.reader.other_sender():
            return other
        if self._silent or not self.watch.counts.rows:
            found = self._columns.found
            if wrong and found is not None:
                wanted = list_names([name for name in self.wiring.columns if name] or self.wiring.used)
                has = list_names([shortened(name) for name in found])
                return f"its rows have other columns than glove.toml: {has}, not {wanted}"
            if misfits > 0 and (odd := self.reader.odd):
                return f"the data holds no rows: {odd}"
        if self._silent:
            return (
                "bytes come, but no row: check the line ends and, of a serial port, the baud rate"
                if received
                else _SILENT
            )
        if now_us() < self._fault_until_us:
            return self._fault
        if self._columns.absent:
            advice = (
                "name columns in glove.toml as it does" if self.wiring.board is None else "upload this build's sketch"
            )
            return f"its rows lack {list_names(self._columns.absent)}: {advice}"
        return self._wrong_rate() or self.taxel_faults()

    def _wrong_rate(self) -> str:
        hz, stated = self.watch.hz, self.wiring.rate_hz
        if hz is None or (hz >= _SLOW * stated and self.watch.steady_hz <= _FAST * stated):
            return ""
        # A rate that wavers a little is no other fault.
        if abs(hz - self._told_hz) > _WAVERS * self._told_hz:
            self._told_hz = hz
        hz = self._told_hz
        two = "" if hz < stated else ", unless two programs send"
        return (
            f"{hz:.3g} rows a second arrive, but glove.toml says {stated:g}: set rate_hz = {float(f'{hz:.2g}'):g}{two}"
        )

    def _uncounted(self) -> tuple[int, int, int]:
        """Return how many rows had other columns, how many lines were not rows, and how many bytes came."""
        return self.watch.counts.wrong_columns, self.reader.counts().misfits, self.reader.received

    @property
    def _silent(self) -> bool:
        return now_us() - self._came_us > max(_NOTICE_US, 4 * self.wiring.period_us)

    def close(self) -> None:
        """Close the reader."""
        self.reader.close()


class _Grid:
    """The grid on which numbers of a range are coded: one end has the code `first`, the other `last`."""

    __slots__ = ("_low", "_span", "first", "last")

    def __init__(self, limits: Range, first: int, last: int) -> None:
        self._low, high = limits
        self._span, self.first, self.last = high - self._low, first, last

    def code(self, value: float) -> int:
        """Return the code of a number, beyond first and last if it is out of the range. For whole numbers in a range
        with whole ends it is exact: divided last, and rounded once.
        """
        far = (value - self._low) * (self.last - self.first) / self._span
        return self.first + round(min(max(far, -1e6), 1e6))


def steps_of(limits: Range) -> int:
    """Return the number of steps for a taxel's range: its whole numbers, if it has whole ends and enough of them."""
    span = abs(limits[1] - limits[0])
    whole = all(float(end).is_integer() for end in limits) and _FEWEST_STEPS <= span <= _MOST_STEPS
    return int(span) if whole else _TAXEL_STEPS


class RowKind(SourceKind, frozen=True, kw_only=True):
    """A kind of source that delivers rows. `reader` makes the reader of a stream's rows and opens nothing."""

    reader: Callable[[StreamWiring], RowReader]


def kind_of(port: str) -> str:
    """Return the name of the kind of source that opens a port of rows: its prefix, or "line"."""
    prefix, colon, _ = port.partition(":")
    return prefix if prefix + colon in OTHER_PORTS else "line"


def row_kind(name: str, reader: Callable[[StreamWiring], RowReader], rank: int) -> RowKind:
    """Return the kind of source called `name`."""

    def sources(
        harness: Harness, _names: Sequence[str], scan: ScanMap, taxels: TaxelCalibration | None
    ) -> Iterator[Source]:
        for number, wiring in enumerate(harness.streams):
            if kind_of(wiring.port) == name:
                yield RowSource(reader(wiring), harness, number, scan, taxels)

    return RowKind(name, sources, rank, reader=reader)
