"""Every device of a harness, each kept open in a thread of its own, and the newest that they delivered."""

from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, Self

from ..harness.wiring import Harness
from ..scanning.scanmap import ScanMap
from .arrivals import Arrivals, Taken
from .devices import GloveDevice, ScannerDevice
from .frames import GloveFrame, SwitchFrame, now_us
from .health import DeviceHealth
from .i2c_device import I2cDevice
from .joiner import LiveRecognizer
from .keeper import DeviceState, Keeper
from .parts import Part, Parts

_PATIENCE_US = 100_000


class Sources:
    """The devices of `harness`, from entering this context to leaving it.

    switch_names  the switches wanted, in the order of the frames' bits: a build's kept switches
    scan          which ports of the I2C expanders to read, in which order
    scout         a recogniser of their own, by which scans end early where one bus reads all switches; None: none does
    """

    def __init__(
        self, harness: Harness, switch_names: Sequence[str], scan: ScanMap, scout: LiveRecognizer | None = None
    ) -> None:
        self.gloves = () if harness.cyberglove is None else (GloveDevice(harness.cyberglove),)
        self.scanners = tuple(ScannerDevice(wiring, switch_names, harness.debounce) for wiring in harness.scanners)
        buses = sorted({port.bus for port in scan.ports})
        alone = scout if len(buses) == 1 and not any(scanner.owned for scanner in self.scanners) else None
        self.buses = tuple(I2cDevice(harness, bus, scan, alone, self.glove) for bus in buses)
        switch_devices: tuple[ScannerDevice | I2cDevice, ...] = (*self.scanners, *self.buses)
        self._parts = Parts(len(switch_names), [Part(device.owned) for device in switch_devices])
        self._arrivals = Arrivals(self._parts)
        self._readers = switch_devices
        self._devices = (*switch_devices, *self.gloves)
        self._keepers: list[Keeper[Any]] = [
            Keeper(device.name, device, self._taking(part, device))
            for part, device in zip(self._parts.parts, switch_devices, strict=True)
        ]
        self._keepers += [Keeper(glove.name, glove, self._arrivals.put_glove) for glove in self.gloves]

    def switches(self) -> SwitchFrame | None:
        """Return the newest frame of the switches, None before the first."""
        return self._arrivals.switches

    def glove(self) -> GloveFrame | None:
        """Return the newest frame of the glove, None before the first."""
        return self._arrivals.glove

    def wait(self, timeout_s: float) -> bool:
        """Wait until something has come in that was not taken; return whether it has."""
        return self._arrivals.wait(timeout_s)

    def take(self) -> Taken:
        """Return the newest frames, and all that arrived since the last call."""
        return self._arrivals.take()

    @property
    def patience_s(self) -> float:
        """How long to wait for something new: until what there is becomes too old, a period where nothing is left."""
        left_us = self._arrivals.fresh_for_us(now_us(), self.glove_period_us)
        if left_us is None:
            periods = [period for period in (self.switch_period_us, self.glove_period_us) if period]
            left_us = min(periods, default=_PATIENCE_US)
        return left_us / 1e6

    @property
    def switch_period_us(self) -> int | None:
        """How often the switches should come at least; None where nothing reads them."""
        return max((device.period_us for device in self._readers), default=None)

    @property
    def glove_period_us(self) -> int | None:
        """How often the glove should send; None where there is none."""
        return max((glove.period_us for glove in self.gloves), default=None)

    def devices(self) -> tuple[DeviceState, ...]:
        """Return how every device fares."""
        return tuple(keeper.state for keeper in self._keepers)

    def health(self) -> tuple[DeviceHealth, ...]:
        """Return how every device fares, with what its driver counts."""
        return tuple(
            DeviceHealth(state.name, state.connected, state.error or device.trouble(), device.counts())
            for state, device in zip(self.devices(), self._devices, strict=True)
        )

    @property
    def overflowed(self) -> int:
        """How many frames came in that nobody took in time; a recording lacks them."""
        return self._arrivals.overflowed

    @property
    def failed(self) -> bool:
        """Whether a device can never work as it is told to."""
        return any(keeper.failure is not None for keeper in self._keepers)

    def raise_settings(self) -> None:
        """Raise the SettingError of a device that can never work as it is told to."""
        for keeper in self._keepers:
            if keeper.failure is not None:
                raise keeper.failure

    def __enter__(self) -> Self:
        for keeper in self._keepers:
            keeper.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # All are told first: each may take as long as one reading.
        for keeper in self._keepers:
            keeper.stop()
        for keeper in self._keepers:
            keeper.close()

    def _taking(self, part: Part, device: ScannerDevice | I2cDevice) -> Callable[[SwitchFrame], None]:
        return lambda frame: self._arrivals.put_switches(part, frame, device.longest_us)
