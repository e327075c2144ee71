"""The serial lines: frames sent as bytes, and their decoding by drivers.

Two lines of 8 data bits, no parity, one stop bit: of 1,000,000 baud with the rows that a board prints, of its switches
and taxels, and of 115,200 baud with the CyberGlove's streamed records, which the glove sends after digitising its
sensors one by one, which limits it to 160 records a second. The numbers of a row are padded with zeros, so all rows
have the same length. The names of the columns, which a board prints once a second, are left out, since the receiver
knows how many there are.
The wire effects act on the bytes between `SEND` and `RECEIVE`.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from thenar.drivers import cyberglove_protocol as glove
from thenar.drivers.lines import CLOCK_US, SEQUENCES, LineParser, checked, switches_field

from ..body.layout import murakami160
from ..errors import SceneError
from ..streams import Draw
from .batch import Batch, Bits, Integers, SerialTraffic
from .effect import Effect, SceneSetting, Step

Bytes = NDArray[np.uint8]
Codes = NDArray[np.uint16]
# From chunks of bytes to the payloads of completed frames.
Feed = Callable[[bytes], list[bytes]]

BOARD_BAUD, GLOVE_BAUD = 1_000_000, 115_200
_BITS_A_BYTE = 10
_DIGITISED_US = round(glove.digitising_us(glove.SENSORS))
# Bytes that end a frame: a row's line, which an end of two bytes keeps apart if one is lost, and a record.
_LINE_ENDS, _RECORD_ENDS = b"\r\n", b"\0"
# A value of a received row.
_CODE = "<u2"
_MOST_COUNTS = np.iinfo(np.uint16).max


def _send(setting: SceneSetting) -> Step:
    _check_rate(setting)

    def send(batch: Batch, draw: Draw) -> None:
        """Send bits and counts after their scan, and raw bytes after digitisation, which starts with the frame."""
        scanned = batch.frame_us if batch.delay_us is None else batch.frame_us + batch.delay_us.max(axis=-1)
        rows, records = _rows(batch.bits, batch.taxels, batch.frame_us), _records(batch.raw)
        data = np.concatenate([rows, records], axis=2)
        at_us = [_arrivals(scanned, rows.shape[2], BOARD_BAUD)]
        at_us.append(_arrivals(batch.frame_us + _DIGITISED_US, records.shape[2], GLOVE_BAUD))
        batch.traffic = SerialTraffic(data, np.concatenate(at_us, axis=2), np.ones(data.shape, np.bool_), rows.shape[2])
        draw.count("bytes sent", data.size)

    return send


def _check_rate(setting: SceneSetting) -> None:
    row = _row(0, 0, np.zeros(len(murakami160()), np.bool_), np.zeros(len(setting.taxels), np.uint16))
    record_us = _sent_us(glove.SENSORS + glove.OVERHEAD, GLOVE_BAUD)
    longest = max(_sent_us(len(row), BOARD_BAUD), _DIGITISED_US + record_us)
    if setting.timed and setting.period_us < longest:
        raise SceneError(
            f"recording.rate_hz: {1e6 / setting.period_us:g} frames a second are more than the glove's serial lines"
            f" deliver: one takes {longest} µs; request at most {1_000_000 // longest}, or list no wire effects"
        )


def receive(batch: Batch, draw: Draw) -> None:
    """Decode the received bytes like a driver, and take for each frame the newest data when it is due.

    If a row or a record is lost, the previous one stays valid. Before the first there is no contact, and the joints are
    those of the first to come. A repetition without any data on one line is not `settled`.
    """
    traffic, switches = batch.traffic, batch.bits.shape[2]
    columns = switches + (0 if batch.taxels is None else batch.taxels.shape[2])
    board, glove_line = slice(0, traffic.board), slice(traffic.board, None)
    rows, row_came = _received(traffic, board, 2 * columns, _LINE_ENDS, lambda: _values(columns))
    records, record_came = _received(traffic, glove_line, glove.SENSORS, _RECORD_ENDS, _sensors)
    row, record = _newest(row_came), _newest(record_came)
    record = np.where(record >= 0, record, np.argmax(record_came, axis=1)[:, None])
    newest = np.take_along_axis(rows.view(_CODE), np.maximum(row, 0)[:, :, None], axis=1) * (row >= 0)[:, :, None]
    batch.bits = newest[:, :, :switches] != 0
    if batch.taxels is not None:
        batch.taxels = newest[:, :, switches:].astype(np.uint16)
    batch.raw = np.take_along_axis(records, record[:, :, None], axis=1)
    batch.settled = batch.settled & row_came.any(axis=1) & record_came.any(axis=1)
    batch.lost = ~(row_came & record_came)


def _rows(bits: Bits, taxels: Codes | None, frame_us: Integers) -> Bytes:
    codes = np.zeros((*bits.shape[:2], 0), np.uint16) if taxels is None else taxels
    lines = [
        _row(number, *frame)
        for repetition in zip(frame_us.tolist(), bits, codes, strict=True)
        for number, frame in enumerate(zip(*repetition, strict=True))
    ]
    return _matrix(lines, bits.shape[:2])


def _row(number: int, time_us: int, bits: Bits, codes: Codes) -> bytes:
    """Return the line of one frame, with all numbers as long as they can be."""
    closed = int.from_bytes(np.packbits(bits, bitorder="little").tobytes(), "little")
    head = (f"{number % SEQUENCES:05}", f"{time_us % CLOCK_US:010}", switches_field(closed, len(bits)))
    return checked(("row", *head, *(f"{code:05}" for code in codes.tolist())))


def _records(raw: Bytes) -> Bytes:
    return _matrix([glove.encode(glove.Record(one.tobytes())) for some in raw for one in some], raw.shape[:2])


def _matrix(sent: list[bytes], shape: tuple[int, ...]) -> Bytes:
    return np.frombuffer(b"".join(sent), dtype=np.uint8).reshape(*shape, -1)


def _arrivals(ready_us: Integers, size: int, baud: int) -> Integers:
    """Return the arrival times of bytes (n, F, size) of frames ready at (n, F), sent one after the other."""
    turn = np.arange(ready_us.shape[1]) * _sent_us(size, baud)
    starts = np.maximum.accumulate(ready_us - turn, axis=1) + turn
    times: Integers = starts[:, :, None] + np.array([_sent_us(count, baud) for count in range(1, size + 1)])
    return times


def _sent_us(size: int, baud: int) -> int:
    return -(-size * _BITS_A_BYTE * 1_000_000 // baud)


def _received(
    traffic: SerialTraffic, line: slice, width: int, ends: bytes, decoder: Callable[[], Feed]
) -> tuple[Bytes, Bits]:
    """Return the data received in time for each frame (n, F, width), and whether there was any (n, F)."""
    at_us, arrives = traffic.at_us[:, :, line], traffic.arrives[:, :, line]
    values = np.ones((*at_us.shape[:2], width), dtype=np.uint8)
    came = np.zeros(at_us.shape[:2], dtype=np.bool_)
    for row, (data, times, through) in enumerate(zip(traffic.data[:, :, line], at_us, arrives, strict=True)):
        decoded = [pair for pair in _decoded(data[through], times[through], ends, decoder()) if len(pair[1]) == width]
        frames = np.searchsorted(times[:, -1], [time for time, _ in decoded])
        whole = b"".join([value for _, value in decoded])
        values[row, frames] = np.frombuffer(whole, dtype=np.uint8).reshape(-1, width)
        came[row, frames] = True
    return values, came


def _decoded(data: Bytes, at_us: Integers, ends: bytes, feed: Feed) -> Iterator[tuple[int, bytes]]:
    """Yield the payload of each frame and the arrival time of its last byte; like a driver, split at its ends."""
    start, whole = 0, data.tobytes()
    for end in np.flatnonzero(np.isin(data, list(ends))).tolist():
        for value in feed(whole[start : end + 1]):
            yield int(at_us[end]), value
        start = end + 1


def _values(columns: int) -> Feed:
    """Return a decoder of rows of this number of columns to their values, each in the two bytes of _CODE."""
    parser = LineParser(columns)

    def feed(chunk: bytes) -> list[bytes]:
        rows = [row.values for row in parser.feed(chunk) if row.sequence is not None]
        # Damage that the checksum does not show can empty a field, or make a number too large.
        sound = [values for values in rows if all(value is not None and 0 <= value <= _MOST_COUNTS for value in values)]
        return [np.array(values).astype(_CODE).tobytes() for values in sound]

    return feed


def _sensors() -> Feed:
    decoder = glove.RecordDecoder()
    return lambda chunk: [record.sensors for record in decoder.feed(chunk) if record.fault is None]


def _newest(came: Bits) -> NDArray[np.intp]:
    """Return for each frame (n, F) the number of the newest received one, -1 before the first."""
    return np.maximum.accumulate(np.where(came, np.arange(came.shape[1]), -1), axis=1)


SEND = Effect(
    name="glove.send",
    summary="puts rows and records on the serial lines as bytes",
    order=800,
    reads=("bits", "raw", "frame_us", "delay_us", "taxels"),
    writes=("traffic",),
    on_wire=True,
    prepare=_send,
)
RECEIVE = Effect(
    name="glove.receive",
    summary="decodes the received bytes like a driver",
    order=830,
    reads=("traffic", "bits", "settled", "taxels"),
    writes=("bits", "raw", "lost", "settled", "taxels"),
    on_wire=True,
    prepare=lambda _setting: receive,
)
