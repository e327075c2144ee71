"""The time of a scan: arithmetic of the wire, and the overhead of calls."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fcntl import ioctl
from math import fsum
from statistics import median

from msgspec.structs import replace

from thenar.drivers.cyberglove_protocol import SENSORS, sensors_with
from thenar.runtime.harness.wiring import GloveWiring, Harness
from thenar.runtime.scanning.plan import Costs, plan_scan
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.scanning.timing import glove_us

from ...firmware.targets import TARGETS
from ..points import How, PointTime
from .classify_times import on_a_pi
from .wirings import WiringOption

NO_TIME = PointTime(0.0, "wire")
# Overhead of one transfer on a Raspberry Pi. Doubtful: a kernel trace of a Pi 3 has 20 us from the call to the adapter
# and 6 us back; others measured 300 us (Pi Zero) with an older library.
PI_CALL_US = 30.0
_CALLS, _BATCHES = 200, 9


@dataclass(frozen=True, slots=True)
class ReadingCost:
    """Microseconds of reading a number of things: a constant, and for each of them; no less than least_us.

    Of joints, it is the time of a record; of transactions, the overhead of each in addition to the wire.

    how   the source of these times: "formula" is the vendor's for a CyberGlove
    what  a sentence on them
    """

    fixed_us: float = 0.0
    each_us: float = 0.0
    least_us: float = 0.0
    how: How = "wire"
    what: str = ""

    def of(self, count: int) -> PointTime:
        """Return the time of reading this number of them."""
        return PointTime(max(self.fixed_us + count * self.each_us, self.least_us), self.how) if count else NO_TIME


NO_RECORDS = ReadingCost()
WIRE_ONLY = ReadingCost(what="scans are those of the wire alone")


def overhead_of(target: str) -> ReadingCost:
    """Return the reading overhead on `target` (a name of `frontier --target`)."""
    if target in TARGETS and TARGETS[target].clock_hz is not None:
        return ReadingCost(what=f"scans on {target} are those of the wire alone, without the time of its program")
    if target == "pi" and not on_a_pi():
        return ReadingCost(
            each_us=PI_CALL_US,
            how="guess",
            what=f"a transfer on a Raspberry Pi is taken to have {PI_CALL_US:g} us of overhead, which is a guess from "
            "a kernel trace of a Pi 3: run thenar frontier on the Pi itself",
        )
    us = measured_call_us()
    return ReadingCost(
        each_us=us,
        what=f"a transfer has {us:.1f} us of overhead, measured here: the system call, without the adapter's driver",
    )


def measured_call_us() -> float:
    """Return the time of a transfer here, made as by drivers.i2c.node, on a device that rejects it at once.

    The median of several means, which is robust against other work.
    """
    from smbus2 import i2c_msg
    from smbus2.smbus2 import I2C_RDWR, i2c_rdwr_ioctl_data

    reply = i2c_msg.read(0x20, 2)
    messages = [i2c_msg.write(0x20, b"\x12"), reply]
    transfer = i2c_rdwr_ioctl_data.create(*messages)  # type: ignore[arg-type]  # as in node.py
    device = os.open(os.devnull, os.O_RDWR)
    try:
        return median(
            _mean_us(lambda: ioctl(device, I2C_RDWR, transfer), lambda: bytes(reply)) for _ in range(_BATCHES)
        )
    finally:
        os.close(device)


def _mean_us(call: Callable[[], object], converted: Callable[[], object]) -> float:
    start = time.perf_counter()
    for _ in range(_CALLS):
        with suppress(OSError):
            call()
        converted()
    return 1e6 * (time.perf_counter() - start) / _CALLS


@dataclass(frozen=True, slots=True)
class ScanTimes:
    """Time of reading the kept switches in one wiring, at this clock.

    us     microseconds of a scan; buses are read one after another, as `scan_us` of the runtime adds them up
    ports  transactions, where a stream's row is one; chips: those that are read
    how    "wire", or "guess" if a guess is included
    """

    wiring: str
    clock_hz: int
    us: float
    ports: int
    chips: int
    how: How


def scan_times(names: Sequence[str], wiring: WiringOption, overhead: ReadingCost = WIRE_ONLY) -> ScanTimes:
    """Return the scan times of a build's switches `names`, in its order.

    overhead is added to every transaction. Streams and buses work in parallel, so the slowest counts. Raises
    HarnessError if a switch has no place.
    """
    harness = wiring.harness_of(names)
    scan = plan_scan(names, harness)
    rows_us = [
        float(stream.period_us)
        for stream, read in zip(harness.streams, scan.streams, strict=True)
        if read.switches + read.levels
    ]
    return ScanTimes(
        wiring=wiring.name,
        clock_hz=wiring.clock_hz,
        us=max(_bus_us(scan, harness, overhead.each_us), *rows_us, 0.0),
        ports=len(scan.ports) + len(rows_us),
        chips=len({(port.bus, port.chip) for port in scan.ports}),
        how=overhead.how,
    )


def _bus_us(scan: ScanMap, harness: Harness, call_us: float) -> float:
    """Return the time of a scan of the chips, if there are any."""
    if not scan.ports:
        return 0.0
    costs, read, us = Costs(scan.ports, harness), 0, list[float]()
    for number in range(len(scan.ports)):
        # Selecting a channel is a transaction as well.
        wire_ns = costs.after(read, number)
        selected = wire_ns > costs.after(read | 1 << number, number)
        us.append(wire_ns / 1000 + call_us * (1 + selected))
        read |= 1 << number
    return fsum(us)


def records_of(
    joints: Sequence[str],
    given_us: float | None = None,
    glove: GloveWiring | None = None,
    *,
    masked: bool = True,
) -> ReadingCost:
    """Return the time of reading some of the joints with these names.

    A CyberGlove, whose sensors may have other names if it is wired as `glove`, sends only the requested ones if its
    mask is set (`masked`), else all of its 18 or 22. Its time is `glove_us`: as measured if glove.toml has it, else by
    the vendor's formula. `given_us` for all joints overrides that. The time of other joints is unknown.
    """
    if given_us is not None and joints:
        return ReadingCost(each_us=given_us / len(joints), how="given")
    named = () if glove is None else glove.joints
    sensors = len(named) if joints and set(joints) <= set(named) else sensors_with(joints)
    if sensors is None:
        return ReadingCost(how="unknown" if joints else "wire")
    wired = glove or GloveWiring(port="-", sensors=22 if sensors > SENSORS else None)
    fixed, more = (glove_us(replace(wired, rate_hz=None), count) for count in (0, 1))
    least = 0.0 if masked else fixed + sensors * (more - fixed)
    if wired.rate_hz:
        least = max(least, 1e6 / wired.rate_hz)
    how: How = "formula" if wired.record_us is None else "measured"
    return ReadingCost(fixed, more - fixed, least, how, _RECORDS[how])


_RECORDS: Mapping[How, str] = {
    "formula": "a CyberGlove's record is the vendor's formula, of a single source: each sensor is digitised in 250 us "
    "(376 us through the filter) before the record is sent; thenar doctor measures a connected glove",
    "measured": "a CyberGlove's record is record_us of glove.toml, as measured, and for fewer sensors "
    "in proportion to the vendor's formula",
}
