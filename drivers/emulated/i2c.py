"""Emulated expanders on real device nodes: an unchanged driver opens /dev/i2c-N and finds them there.

umockdev (Debian packages umockdev, gir1.2-umockdev-1.0, python3-gi) intercepts a client's system calls, so the client
must be a separate process, started with `EmulatedI2c.environment`. It needs no kernel modules or privileges.
"""

import json
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryFile
from threading import Lock
from types import MappingProxyType
from typing import Any, Literal

from ..closing import Closing
from ..errors import DeviceError, SettingError
from ..i2c.chips import CHIPS
from ..spi.chips import SPI_CHIPS
from .i2c_wire import Place

_PYTHON = "/usr/bin/python3"
# Isolated: neither the current folder nor the user's, with foreign modules, is on its path.
_SERVE = "import runpy, sys; sys.path.append(sys.argv[1]); runpy.run_module(sys.argv[2], run_name='__main__')"
_INSTALL = "install the packages umockdev, gir1.2-umockdev-1.0 and python3-gi (Debian, Ubuntu)"

AdapterKind = Literal["any", "bcm2835", "designware", "i2c-gpio"]


@dataclass(frozen=True, slots=True)
class EmulatedChip:
    """A chip and its location: directly on the bus or on a channel of the TCA9548A at address `mux`."""

    kind: str
    address: int
    mux: int | None = None
    channel: int | None = None


@dataclass(frozen=True, slots=True)
class EmulatedBus:
    """A bus at `device` (/dev/i2c-N); `paced`: each transfer takes as long as its SCL periods at `clock_hz`."""

    device: str
    clock_hz: int
    adapter: AdapterKind
    chips: tuple[EmulatedChip, ...]
    paced: bool = True


@dataclass(frozen=True, slots=True)
class WireCounters:
    """Counts of a bus: ioctl calls, transfers (each ended by a STOP), SCL periods, and bytes by place."""

    calls: int
    transfers: int
    scl_periods: int
    traffic: Mapping[Place, int]

    @property
    def total_bytes(self) -> int:
        """Bytes on the wire, including addresses."""
        return sum(self.traffic.values())


class EmulatedI2c(Closing):
    """The buses and SPI devices of a glove, served by a separate process.

    spi  the kind of the converter at each device (/dev/spidevB.C); None: no chip, and the line is high

    Chips are numbered in the order of their bus; SPI devices are numbered after the buses, with one chip each. A client
    sees them if it runs with `environment`. Pins start high, and channels at 0 V; the levels of a converter are its
    channels' codes, 16 bits each. Raises DeviceError with the packages to install if umockdev is missing, and
    SettingError for a chip that cannot be emulated.
    """

    def __init__(self, buses: Sequence[EmulatedBus], spi: Mapping[str, str | None] = MappingProxyType({})) -> None:
        unknown = sorted({chip.kind for bus in buses for chip in bus.chips} - set(CHIPS))
        unknown += sorted({kind for kind in spi.values() if kind} - set(SPI_CHIPS))
        if unknown:
            raise SettingError(f"cannot emulate {', '.join(unknown)}; supported: {', '.join(CHIPS)}")
        wrapper = shutil.which("umockdev-wrapper")
        if wrapper is None:
            raise DeviceError(f"the program umockdev-wrapper is missing: {_INSTALL}")
        self._errors = TemporaryFile("w+")  # noqa: SIM115 - it lives as long as the server; a pipe would fill up
        self._server = subprocess.Popen(
            [wrapper, _PYTHON, "-I", "-c", _SERVE, _folder(__name__), f"{__package__}.i2c_server"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            start_new_session=True,  # Ctrl-C is for us; the server ends when its stdin does
        )
        self._lock = Lock()
        self._root: str | None = None
        try:
            devices = [_spi_described(*device) for device in spi.items()]
            self._root = self._tell(([_described(bus) for bus in buses], devices))
        except BaseException:
            self.close()
            raise
        self.environment = {"UMOCKDEV_DIR": str(self._root), "LD_PRELOAD": "libumockdev-preload.so.0"}

    def set_levels(self, bus: int, chip: int, levels: int) -> None:
        """Set the pins of one chip: bit p is pin p, 1 is high or open; or a converter's codes."""
        self._tell([(bus, "set_levels", chip, levels)])

    def set_all(self, levels: Sequence[Sequence[int]]) -> None:
        """Set the pins of all chips of all buses at one time."""
        self._tell(
            [(bus, "set_levels", chip, one) for bus, chips in enumerate(levels) for chip, one in enumerate(chips)]
        )

    def counters(self, bus: int) -> WireCounters:
        """Return the counts of the bus since the start."""
        ((calls, transfers, periods, traffic),) = self._tell([(bus, "counters")])
        return WireCounters(calls, transfers, periods, {Place(*place): count for place, count in traffic})

    def fault(self, bus: int, name: str, *arguments: Any, **options: Any) -> None:
        """Inject a fault: call this method of the bus's `i2c_wire.Adapter`, such as "fail", "remove" or "heal"."""
        self._tell([(bus, "fault", name, arguments, options)])

    def replace(self, bus: int, chip: int, kind: str) -> None:
        """Replace a chip by a new one of another kind."""
        self._tell([(bus, "replace", chip, _model(kind))])

    def unplug(self, bus: int) -> None:
        """Remove the adapter: its node is gone, and clients that have it open get ENODEV."""
        self._tell([(bus, "unplug")])

    def replug(self, bus: int) -> None:
        """Bring the adapter back."""
        self._tell([(bus, "replug")])

    def close(self) -> None:
        """End the server and its device nodes. Closing twice is harmless."""
        if not self._errors.closed:
            self._end()
            self._errors.close()
            if self._root is not None:  # a killed server leaves it behind
                shutil.rmtree(self._root, ignore_errors=True)

    def _tell(self, line: Any) -> Any:
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        with self._lock:
            if self._server.stdout.closed:
                raise DeviceError("the emulated I2C buses have ended: create new ones")
            with suppress(BrokenPipeError):
                self._server.stdin.write(json.dumps(line) + "\n")
                self._server.stdin.flush()
            reply = self._server.stdout.readline()
            if not reply:
                raise DeviceError(f"the emulated I2C buses have ended ({self._last_words()}): {_INSTALL}")
        return json.loads(reply)

    def _end(self) -> None:
        """End the server by closing its stdin; kill it if it hangs."""
        if self._server.stdout is None or self._server.stdout.closed:
            return
        with suppress(BrokenPipeError):
            try:
                self._server.communicate(timeout=10)
            except subprocess.TimeoutExpired:
                self._server.kill()
                self._server.communicate()

    def _last_words(self) -> str:
        self._end()
        self._errors.seek(0)
        return self._errors.read().strip().rpartition("\n")[2]


def _described(bus: EmulatedBus) -> dict[str, Any]:
    """Return a bus in the form of the server's first line, with each chip's model as its kind."""
    return {**asdict(bus), "chips": [{**asdict(chip), "kind": _model(chip.kind)} for chip in bus.chips]}


def _spi_described(device: str, kind: str | None) -> tuple[Any, ...]:
    if kind is None:
        return device, None
    chip = SPI_CHIPS.named(kind)
    return device, _place_of(chip.model), len(chip.pins), chip.bits


def _model(kind: str) -> tuple[str, str, str]:
    return _place_of(CHIPS.named(kind).model)


def _place_of(model: type) -> tuple[str, str, str]:
    """Return the location, for another Python, of the class that emulates a chip: folder, module and name."""
    return _folder(model.__module__), model.__module__, model.__qualname__


def _folder(module: str) -> str:
    """Return the folder from which `module` is imported."""
    return str(Path(sys.modules[module].__file__ or "").absolute().parents[module.count(".")])
