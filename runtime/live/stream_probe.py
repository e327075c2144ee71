"""What an unknown sender sends, and a proposal of the glove.toml that reads it."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import astuple
from itertools import pairwise
from math import ceil, floor, log10, pi
from statistics import median

import msgspec

from thenar.drivers.cyberglove import CyberGlove
from thenar.drivers.cyberglove_protocol import SENSORS_22
from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.frames import FrameParser, guess_frame
from thenar.drivers.lines import UNITS_US, Row, RowReader
from thenar.drivers.readers import LineReader
from thenar.drivers.transports import OTHER_PORTS, is_serial

from ..frames import now_us
from ..harness.wiring import GloveWiring, Harness, Range, StreamWiring
from ..names import fault, list_names
from ..sources.base import SOURCES
from ..sources.rows import RowKind, kind_of

# The prefix of the port of a CyberGlove, which sends nothing unless it is asked.
CYBERGLOVE = "cyberglove:"
# Boards that are reset when their port opens start their program within this time.
_PATIENCE_US = 6_000_000
_MOST_ROWS = 100_000
_WAIT_S = 0.1
# A sender that leaves no pause is read as fast as it sends after this time.
_BACKLOG_US = 100_000
_JOINT = re.compile(
    r"flex|bend|splay|joint|angle|deg|enc|mcp|mpj|pip|pij|dip|dij|(^|_)ip($|_)|abduct|wrist|pitch|roll|yaw",
    re.IGNORECASE,
)
_TAXEL = re.compile(r"fsr|pad|force|press|taxel|adc|analog|raw|newton", re.IGNORECASE)
_UNIT = {unit: re.compile(named) for unit, named in (("s", "^s$|(^|_)sec"), ("ms", "ms|milli"), ("us", "us|micro"))}
_TIME = re.compile(r"^(t|ts|ms|us|s)$|time|milli|micro|stamp|clock|(^|_)secs?$|seconds", re.IGNORECASE)
_HIGHEST = (255, 1023, 4095, 16_383, 32_767, 65_534)
_PARTS = (1.0, 3.3, 5.0, 10.0, 100.0, 180.0, 360.0)
# A joint or a taxel that moved over this share of its converter's range was moved on purpose.
_MOVED = 0.1
_KINDS, _STILL = ("switch", "joint", "taxel"), "nothing: it did not move"
# The range of a joint in rad that did not move.
_WHOLE_TURN = (-round(pi, 4), round(pi, 4))
# In less time no rate can be measured: the rows had been waiting somewhere.
_LEAST_S = 0.3
_NO_RATE = "the rows came all at once: set rate_hz to the number of rows a second"


class ColumnGuess(msgspec.Struct, frozen=True):
    """A received column: its least and greatest number, and its proposed use."""

    column: str
    least: float | None
    greatest: float | None
    taken_for: str


class Proposal(msgspec.Struct, frozen=True):
    """The glove.toml that fits a sender, its columns, and remarks on oddities, in sentences."""

    harness: Harness
    columns: tuple[ColumnGuess, ...]
    rows: int
    remarks: tuple[str, ...]

    @property
    def sensors(self) -> tuple[str, ...]:
        """The names of all its switches, taxels and joints."""
        return (*self.harness.switches, *self.harness.taxel_names, *self.harness.sensor_names)


def propose_glove(port: str, baud: int, listen_s: float, columns: Sequence[str] = ()) -> Proposal:
    """Return the glove.toml that fits what `port` sends within `listen_s` seconds after the first row.

    `port` is that of a stream of rows, whose columns `columns` name if the sender does not; or "cyberglove:" and the
    port of a CyberGlove.

    Raises SettingError for an invalid port, DeviceError if no rows come, or no CyberGlove replies.
    """
    if port.startswith(CYBERGLOVE):
        return _proposed_cyberglove(port.removeprefix(CYBERGLOVE), baud, listen_s, tuple(columns))
    bare = StreamWiring(port=port, columns=tuple(columns))
    if is_serial(port):
        bare = msgspec.structs.replace(bare, baud=baud)
    kind = SOURCES[kind_of(port)]
    assert isinstance(kind, RowKind)
    with kind.reader(bare) as reader:
        chunks: list[tuple[int, bytes]] = []
        if isinstance(reader, LineReader) and not port.startswith(OTHER_PORTS):
            reader.chunks = chunks
        reader.open()
        came = list(_listened(reader, listen_s))
        counts, odd, other = reader.counts(), reader.odd, reader.other_sender()
    sent = [chunk for _, chunk in chunks]
    if len(came) <= counts.misfits + counts.damaged and _is_binary(sent) and (frame := guess_frame(sent)):
        bare, parser = msgspec.structs.replace(bare, frame=frame), FrameParser(frame)
        came = [(time_us, row) for time_us, chunk in chunks for row in parser.feed(chunk)]
        counts, odd = parser.counts, parser.odd
        other = other or f"frames of {frame}: bytes that never changed are taken as fixed, so move every sensor"
    if not came:
        silent = "no data received" + (f"; if it is a CyberGlove, write {CYBERGLOVE}{port}" if is_serial(port) else "")
        raise DeviceError(f"{port}: {_no_rows(bare, reader) or other or silent}")
    wrong, such = counts.misfits + counts.overlong, f", such as {odd}" if odd else ""
    remarks = [f"{wrong} lines were not rows{such}" if wrong > 1 else f"1 line was not a row: {odd}"] if wrong else []
    remarks += [f"{counts.damaged} lines were damaged: check the cable and the baud rate"] if counts.damaged else []
    remarks += [other] if other else []
    remarks += [f"{counts.foreign} rows of another sender were left out"] if counts.foreign else []
    return _proposed(bare, came, reader.kind, remarks)


def _proposed_cyberglove(port: str, baud: int, listen_s: float, joints: tuple[str, ...]) -> Proposal:
    """Return the proposal for the CyberGlove at a port; `joints` name its sensors otherwise than the driver does."""
    records = list[bytes]()
    with closing(CyberGlove(port, baud=baud)) as glove:
        info, end_us = glove.open(), now_us() + round(listen_s * 1e6)
        while now_us() < end_us:
            timed = glove.read(_WAIT_S)
            records += [timed[1].sensors] if timed is not None and timed[1].fault is None else []
    if not records:
        raise DeviceError(f"{port}: the CyberGlove measures nothing: plug it into its box")
    names = _columns(joints, None, info.total, []) if joints else info.names
    values = {name: list(map(float, found)) for name, found in zip(names, zip(*records, strict=True), strict=True)}
    still = [name for name, found in values.items() if _is_still("joint", found)]
    heard = tuple(ColumnGuess(name, min(found), max(found), "joint") for name, found in values.items())
    wiring = GloveWiring(port=port, baud=baud, sensors=22 if info.total == len(SENSORS_22) else None, joints=joints)
    harness = Harness(name="glove", cyberglove=wiring)
    return Proposal(harness, heard, len(records), (*info.notes, *_unmoved(still)))


def _is_binary(chunks: Sequence[bytes]) -> bool:
    """Return whether more than a few bytes are not of text."""
    return 20 * sum(byte < 9 or byte > 126 for chunk in chunks for byte in chunk) > sum(map(len, chunks))


def _no_rows(bare: StreamWiring, reader: RowReader) -> str:
    """Return the reason why no row came, and advice; "" if nothing came at all."""
    baud = f"is {bare.baud} its baud rate? " if is_serial(bare.port) else ""
    if reader.odd:
        wanted = "a row is numbers with commas between, name:value, or JSON"
        more = "--names says how many columns rows with texts have"
        return f"the data holds no rows: {reader.odd}; {baud}{wanted}; {more}"
    if reader.counts().overlong:
        return "its lines are longer than any row: end each row with a line feed"
    return f"{reader.received} bytes came, but no line: {baud}end each row with a line feed" if reader.received else ""


def _listened(reader: RowReader, listen_s: float) -> Iterator[tuple[int, Row]]:
    """Yield rows and when they came. Those that had been waiting, in buffers between the sender and this program, when
    the first one was read came at the same time.
    """
    end_us, count, waited_us, received = now_us() + _PATIENCE_US, 0, 0, 0
    while (time_us := now_us()) < end_us and count < _MOST_ROWS:
        try:
            rows = reader.read(0.0 if waited_us else _WAIT_S)
        except DeviceError:
            if not (count or reader.received or sum(astuple(reader.counts()))):
                raise
            return
        if reader.received and not received:
            end_us = max(end_us, time_us + round(listen_s * 1e6))
        received = reader.received
        if rows and not count:
            waited_us, end_us = time_us, time_us + round(listen_s * 1e6)
        elif not rows or time_us - waited_us > _BACKLOG_US:
            waited_us = 0
        count += len(rows)
        yield from ((row.came_us or waited_us or now_us(), row) for row in rows)


def _proposed(bare: StreamWiring, came: Sequence[tuple[int, Row]], every: str, remarks: list[str]) -> Proposal:
    """Return the proposal for these rows; `every` is the kind of all columns, "" if it is not known."""
    (names, width), most = Counter((row.names, len(row.values)) for _, row in came).most_common(1)[0]
    if most < len(came):
        remarks.append(f"{len(came) - most} of {len(came)} rows had other columns")
    alike = [(time_us, row) for time_us, row in came if (row.names, len(row.values)) == (names, width)]
    columns = _columns(bare.columns, names, width, remarks)
    values = {name: [row.values[place] for _, row in alike] for place, name in enumerate(columns)}
    timed = alike[sum(time_us == alike[0][0] for time_us, _ in alike) - 1 :]
    span_s = (timed[-1][0] - timed[0][0]) / 1e6
    measured = span_s >= _LEAST_S
    if not measured:
        timed = alike
    time, unit, by_clock_s = _clock({name: found[-len(timed) :] for name, found in values.items()}, span_s)
    if not measured:
        span_s = by_clock_s
        remarks.append("the rows came all at once: rate_hz is by their clock" if by_clock_s else _NO_RATE)
    rate_hz = _rounded((len(timed) - 1) / span_s) if span_s > 0 and len(timed) > 1 else bare.rate_hz
    stamped = alike[0][1].time_s is not None
    numbers = {name: [value for value in found if value is not None] for name, found in values.items()}
    kinds = {name: _kind(name, found, every) for name, found in numbers.items()}
    kinds |= {name: "nothing: its name is not valid" for name in columns if names and name not in names}
    still = [name for name, found in numbers.items() if kinds[name] == _STILL or _is_still(kinds[name], found)]
    remarks += _unmoved(still)
    kinds |= {} if time is None else {time: f"the sender's clock, in {unit}"}
    for name, found in values.items():
        if missing := found.count(None):
            remarks.append(f"{name}: {missing} of {len(found)} values were not numbers")
    if time is None and not stamped:
        remarks.append("no column is a clock, so rows are timed when they arrive: add a column of millis() if possible")
    stream = msgspec.structs.replace(
        bare,
        columns=tuple(name if name == time or kinds[name] in _KINDS else "" for name in columns),
        time=time,
        time_unit=unit,
        rate_hz=min(max(rate_hz, 0.1), 10_000.0),
        switches=tuple(name for name, kind in kinds.items() if kind == "switch"),
        joints={name: _joint_range(numbers[name]) for name, kind in kinds.items() if kind == "joint"},
        taxels={name: _range(numbers[name]) for name, kind in kinds.items() if kind == "taxel"},
    )
    heard = (
        ColumnGuess(name, min(found, default=None), max(found, default=None), kinds[name])
        for name, found in numbers.items()
    )
    return Proposal(Harness(name="glove", streams=(stream,)), tuple(heard), len(came), tuple(remarks))


def _unmoved(names: Sequence[str]) -> list[str]:
    """Return a remark on sensors that did not move."""
    return [f"{list_names(names)} did not move: press every pad and bend every finger meanwhile"] if names else []


def _columns(given: tuple[str, ...], names: tuple[str, ...] | None, width: int, remarks: list[str]) -> tuple[str, ...]:
    """Return the names of `width` columns: those that the sender sends, those that the user gave, or c1, c2 and on."""
    if given and len(given) != width:
        raise SettingError(f"{len(given)} columns are named, but rows have {width}: name every one, in order")
    if max(Counter(filter(None, given)).values(), default=1) > 1:
        raise SettingError(f"--names names a column twice: {', '.join(given)}")
    if given and names is not None and given != names:
        remarks.append("the sender names its columns itself, so --names is not used")
    return tuple(
        f"c{place}" if fault(name) else name for place, name in enumerate(names or given or ("",) * width, start=1)
    )


def _rounded(rate_hz: float) -> float:
    """Return a rate rounded to two digits."""
    step: float = 10.0 ** (floor(log10(rate_hz)) - 1)
    return float(f"{round(rate_hz / step) * step:.6g}")


def _clock(values: dict[str, list[float | None]], span_s: float) -> tuple[str | None, str, float]:
    """Return the column that is a clock, preferably one named so, its unit, and its span in seconds."""
    for named in (True, False):
        for name, found in values.items():
            numbers = [value for value in found if value is not None]
            steps = [later - earlier for earlier, later in pairwise(numbers)]
            if bool(_TIME.search(name)) != named or not _rises(numbers) or (not named and set(steps) == {1.0}):
                continue
            going = sum(step for step in steps if 0 < step <= 10 * median(steps)) or 1.0
            for unit, unit_us in UNITS_US.items():
                if span_s < _LEAST_S:
                    fits = _UNIT[unit].search(name.lower()) is not None
                else:
                    fits = 0.5 < going * unit_us / 1e6 / span_s < 2.0
                if fits:
                    return name, unit, going * unit_us / 1e6
    return None, "ms", 0.0


def _rises(numbers: Sequence[float]) -> bool:
    """Return whether numbers rise from nearly every row to the next, as no finger does: but for a restart, or rows that
    come late.
    """
    steps = [later - earlier for earlier, later in pairwise(numbers)]
    rises, falls = [step for step in steps if step > 0], [-step for step in steps if step < 0]
    return len(steps) > 3 and len(rises) > 0.9 * len(steps) and (len(falls) < 2 or sum(falls) < 0.1 * sum(rises))


def _kind(name: str, numbers: Sequence[float], every: str) -> str:
    if not numbers:
        return "nothing: no number came"
    if every:  # in rad: what such a joint turns through is known without moving it
        return _STILL if _is_still(every, numbers) and abs(numbers[0]) > pi else every
    if _rises(numbers):
        return "nothing: it only rises, as a count does"
    if _TIME.search(name) and not {0.0, 1.0} >= set(numbers) and sorted(numbers) == list(numbers):
        return "nothing: a clock that does not change from row to row"
    if _JOINT.search(name):
        kind = "joint"
    elif _TAXEL.search(name) or not {0.0, 1.0} >= set(numbers):
        kind = "taxel"
    else:
        kind = "switch"
    return _STILL if _is_still(kind, numbers) else kind


def _is_still(kind: str, numbers: Sequence[float]) -> bool:
    """Return whether a switch, joint or taxel did not move: what it reads may be noise."""
    if kind not in _KINDS:
        return False
    low, high = (0.0, 1.0) if kind == "switch" else _range(numbers)
    return max(numbers) - min(numbers) < _MOVED * (high - low)


def _range(numbers: Sequence[float]) -> Range:
    """Return the range of the converter, or the scale, that such numbers usually have."""
    least, greatest = min(numbers), max(numbers)
    whole = all(number.is_integer() for number in numbers)
    top = max(abs(least), abs(greatest))
    ends = _HIGHEST if whole else _PARTS
    if (end := next((float(end) for end in ends if top <= end), None)) is not None:
        return (0.0 if least >= 0 else -end, end)
    return _widened(least, greatest)


def _joint_range(numbers: Sequence[float]) -> Range:
    """Return the range that a joint moved over, widened: it has 255 codes; a whole turn if it did not move."""
    if _is_still("joint", numbers):
        return _WHOLE_TURN
    low, high = _range(numbers)
    near = _widened(min(numbers), max(numbers))
    return max(low, near[0]), min(high, near[1])


def _widened(least: float, greatest: float) -> Range:
    span = max(greatest - least, 1e-3, 1e-2 * abs(greatest))
    step = 10.0 ** (floor(log10(span)) - 1)
    ends = floor((least - span / 4) / step) * step, ceil((greatest + span / 4) / step) * step
    return float(f"{ends[0]:.6g}"), float(f"{ends[1]:.6g}")
