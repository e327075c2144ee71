"""The serial lines: frames sent as bytes, and their decoding by drivers.

Two lines of 115200 baud, 8 data bits, no parity, one stop bit: the scanner's STATE frames, after each the ANALOG frames
of its taxels, and the CyberGlove's streamed records, which the glove sends after digitising its sensors one by one,
which limits it to 160 records a second.
The wire effects act on the bytes between `SEND` and `RECEIVE`.
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from thenar.drivers import cyberglove_protocol as glove
from thenar.drivers import scanner_protocol as scanner

from ..body.layout import murakami160
from ..errors import SceneError
from ..streams import Draw
from .batch import Batch, Traffic
from .effect import Effect, EffectParameters, Setting, Step

Bits = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]
# From chunks of bytes to the payloads of completed frames.
Feed = Callable[[bytes], list[bytes]]

BAUD = 115_200
_BITS_A_BYTE = 10
_DIGITISED_US = round(glove.digitising_us(glove.SENSORS))


def _send(parameters: EffectParameters, setting: Setting) -> Step:
    _check_rate(setting)

    def send(batch: Batch, draw: Draw) -> None:
        """Send bits and counts after their scan, and raw bytes after digitisation, which starts with the frame."""
        scanned = batch.frame_us if batch.delay_us is None else batch.frame_us + batch.delay_us.max(axis=-1)
        states, records = np.concatenate([_states(batch.bits), *_analogs(batch.taxels)], axis=2), _records(batch.raw)
        data = np.concatenate([states, records], axis=2)
        at_us = [_arrivals(scanned, states.shape[2]), _arrivals(batch.frame_us + _DIGITISED_US, records.shape[2])]
        batch.traffic = Traffic(data, np.concatenate(at_us, axis=2), np.ones(data.shape, np.bool_), states.shape[2])
        draw.count("bytes sent", data.size)

    return send


def _check_rate(setting: Setting) -> None:
    state = (len(murakami160()) + 7) // 8 + scanner.OVERHEAD
    state_us = _sent_us(state + sum(scanner.OVERHEAD + _width(part) for part in _parts(len(setting.taxels))))
    longest = max(state_us, _DIGITISED_US + _sent_us(glove.SENSORS + glove.OVERHEAD))
    if setting.timed and setting.period_us < longest:
        raise SceneError(
            f"recording.rate_hz: {1e6 / setting.period_us:g} frames a second are more than the glove's serial lines"
            f" deliver: one takes {longest} us; request at most {1_000_000 // longest}, or list no wire effects"
        )


def receive(batch: Batch, draw: Draw) -> None:
    """Decode the received bytes like a driver, and take for each frame the newest data when it is due.

    If a frame of switches or taxels or a glove record is lost, the previous one stays valid. Before the first there is
    no contact, and the joints are those of the first to come. A repetition without any data on one line is not
    `settled`.
    """
    traffic, switches = batch.traffic, batch.bits.shape[2]
    line = slice(0, traffic.scanner)
    states, state_came = _received(traffic, line, (switches + 7) // 8, partial(_payloads, scanner.STATE))
    records, record_came = _received(traffic, slice(traffic.scanner, None), glove.SENSORS, _sensors)
    state, record = _newest(state_came), _newest(record_came)
    record = np.where(record >= 0, record, np.argmax(record_came, axis=1)[:, None])
    bits = scanner.unpack_bits(np.take_along_axis(states, np.maximum(state, 0)[:, :, None], axis=1), switches)
    batch.bits = bits & (state >= 0)[:, :, None]
    batch.raw = np.take_along_axis(records, record[:, :, None], axis=1)
    came = state_came & record_came
    batch.settled = batch.settled & state_came.any(axis=1) & record_came.any(axis=1)
    if batch.taxels is not None:
        taxels = np.zeros_like(batch.taxels)
        for part in _parts(taxels.shape[2]):
            codes, code_came = _received(traffic, line, _width(part), partial(_payloads, scanner.Analog.KIND, part))
            last = _newest(code_came)
            newest = np.take_along_axis(codes, np.maximum(last, 0)[:, :, None], axis=1)[:, :, _HEAD:]
            taxels[:, :, part] = np.ascontiguousarray(newest).view("<u2") * (last >= 0)[:, :, None]
            came &= code_came
            batch.settled = batch.settled & code_came.any(axis=1)
        batch.taxels = taxels
    batch.lost = ~came


def _states(bits: Bits) -> Bytes:
    sent = [
        scanner.encode(scanner.Frame(scanner.STATE, number & 0xFF, payload.tobytes()))
        for repetition in scanner.pack_bits(bits)
        for number, payload in enumerate(repetition)
    ]
    return _matrix(sent, bits.shape[:2])


# Time and token of an ANALOG, before its codes.
_HEAD = scanner.Analog.LAYOUT.size


def _parts(taxels: int) -> list[slice]:
    """Return the taxels of each ANALOG, up to its capacity."""
    return [slice(first, min(first + scanner.MOST_ASKED, taxels)) for first in range(0, taxels, scanner.MOST_ASKED)]


def _width(part: slice) -> int:
    return _HEAD + 2 * int(part.stop - part.start)


def _analogs(taxels: NDArray[np.uint16] | None) -> list[Bytes]:
    if taxels is None:
        return []
    sent = []
    for part in _parts(taxels.shape[2]):
        # The number of its first taxel as token distinguishes an ANALOG from the others.
        head = scanner.Analog.LAYOUT.pack(0, part.start)
        codes = taxels[:, :, part].astype("<u2")
        frames = [
            scanner.encode(scanner.Frame(scanner.Analog.KIND, number & 0xFF, head + one.tobytes()))
            for repetition in codes
            for number, one in enumerate(repetition)
        ]
        sent.append(_matrix(frames, taxels.shape[:2]))
    return sent


def _records(raw: Bytes) -> Bytes:
    return _matrix([glove.encode(glove.Record(one.tobytes())) for some in raw for one in some], raw.shape[:2])


def _matrix(sent: list[bytes], shape: tuple[int, ...]) -> Bytes:
    return np.frombuffer(b"".join(sent), dtype=np.uint8).reshape(*shape, -1)


def _arrivals(ready_us: Integers, size: int) -> Integers:
    """Return the arrival times of bytes (n, F, size) of frames ready at (n, F), sent one after the other."""
    turn = np.arange(ready_us.shape[1]) * _sent_us(size)
    starts = np.maximum.accumulate(ready_us - turn, axis=1) + turn
    times: Integers = starts[:, :, None] + np.array([_sent_us(count) for count in range(1, size + 1)])
    return times


def _sent_us(size: int) -> int:
    return -(-size * _BITS_A_BYTE * 1_000_000 // BAUD)


def _received(traffic: Traffic, line: slice, width: int, decoder: Callable[[], Feed]) -> tuple[Bytes, Bits]:
    """Return the data received in time for each frame (n, F, width), and whether there was any (n, F)."""
    at_us, arrives = traffic.at_us[:, :, line], traffic.arrives[:, :, line]
    values = np.ones((*at_us.shape[:2], width), dtype=np.uint8)
    came = np.zeros(at_us.shape[:2], dtype=np.bool_)
    for row, (data, times, through) in enumerate(zip(traffic.data[:, :, line], at_us, arrives, strict=True)):
        decoded = [pair for pair in _decoded(data[through], times[through], decoder()) if len(pair[1]) == width]
        frames = np.searchsorted(times[:, -1], [time for time, _ in decoded])
        whole = b"".join([value for _, value in decoded])
        values[row, frames] = np.frombuffer(whole, dtype=np.uint8).reshape(-1, width)
        came[row, frames] = True
    return values, came


def _decoded(data: Bytes, at_us: Integers, feed: Feed) -> Iterator[tuple[int, bytes]]:
    """Yield the payload of each frame and the arrival time of its last byte; like a driver, split at zeros."""
    start, whole = 0, data.tobytes()
    for zero in np.flatnonzero(data == 0).tolist():
        for value in feed(whole[start : zero + 1]):
            yield int(at_us[zero]), value
        start = zero + 1


def _payloads(kind: int, part: slice | None = None) -> Feed:
    decoder = scanner.FrameDecoder()

    def feed(chunk: bytes) -> list[bytes]:
        found = [frame.payload for frame in decoder.feed(chunk) if frame.kind == kind]
        return (
            found if part is None else [each for each in found if len(each) >= _HEAD and each[_HEAD - 1] == part.start]
        )

    return feed


def _sensors() -> Feed:
    decoder = glove.RecordDecoder()
    return lambda chunk: [record.sensors for record in decoder.feed(chunk) if record.fault is None]


def _newest(came: Bits) -> NDArray[np.intp]:
    """Return for each frame (n, F) the number of the newest received one, -1 before the first."""
    return np.maximum.accumulate(np.where(came, np.arange(came.shape[1]), -1), axis=1)


SEND = Effect(
    name="glove.send",
    summary="puts frames and records on the serial lines as bytes",
    stage="wire",
    reads=("bits", "raw", "frame_us", "delay_us", "taxels"),
    writes=("traffic",),
    on_wire=True,
    prepare=_send,
)
RECEIVE = Effect(
    name="glove.receive",
    summary="decodes the received bytes like a driver",
    stage="wire",
    reads=("traffic", "bits", "settled", "taxels"),
    writes=("bits", "raw", "lost", "settled", "taxels"),
    on_wire=True,
    prepare=lambda _parameters, _setting: receive,
)
