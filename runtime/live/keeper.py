"""A device that is kept: opened, read in a thread of its own, and opened again whenever its cable comes back."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Event, Thread
from typing import Generic, Protocol, TypeVar

from thenar.drivers.errors import DeviceError, SettingError

from .frames import now_us

T_co = TypeVar("T_co", covariant=True)
T = TypeVar("T")

# What is said of a device before it was tried for the first time.
NOT_YET = "not opened yet"
# Recovery is promised within a second of the cable's return; opening a CyberGlove takes a part of that.
RETRY_S = 0.2
# How long a reading may block before its thread looks whether it is to stop.
READ_S = 0.1


class Device(Protocol[T_co]):
    """What can be kept: `open` and `read` raise DeviceError when the device is gone, SettingError when no try helps."""

    def open(self) -> object:
        """Open the device and make it ready."""

    def read(self, timeout_s: float) -> T_co | None:
        """Return the next sample, None if there is none in time."""

    def close(self) -> None:
        """Close it, in whatever state it is."""


@dataclass(frozen=True, slots=True)
class DeviceState:
    """How a device fares: `error` says what is or was wrong last, since_us when this state began, opened how often it
    was opened.
    """

    name: str
    connected: bool
    error: str
    since_us: int
    opened: int


class Keeper(Generic[T]):
    """Keeps `device` open and hands every sample to `take`, in a thread of its own, until it is closed.

    A SettingError ends it unless the device was open before: `failure` holds it, for whoever waits on the device.
    """

    def __init__(
        self, name: str, device: Device[T], take: Callable[[T], None], changed: Callable[[], None] = lambda: None
    ) -> None:
        """changed() is called whenever the state changes."""
        self.state = DeviceState(name, connected=False, error=NOT_YET, since_us=now_us(), opened=0)
        self.failure: SettingError | None = None
        self._device, self._take, self._changed = device, take, changed
        self._stop = Event()
        self._thread = Thread(target=self._keep, name=f"thenar {name}", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Let it end soon."""
        self._stop.set()

    def close(self) -> None:
        """End: returns once the device is closed."""
        self.stop()
        if self._thread.is_alive():
            self._thread.join()

    def _keep(self) -> None:
        while not self._stop.is_set():
            try:
                self._device.open()
                self._become(connected=True, error="")
                self._read()
            except SettingError as wrong:
                self._become(connected=False, error=str(wrong))
                # What it did before it can do: only a garbled answer can say otherwise.
                if not self.state.opened:
                    self.failure = wrong
                    return
            except DeviceError as wrong:
                self._become(connected=False, error=str(wrong))
            except Exception as fault:  # a fault of ours must not leave a dead thread that passes for a live device
                self._become(connected=False, error=f"{type(fault).__name__}: {fault}")
            finally:
                with suppress(OSError):
                    self._device.close()
            self._stop.wait(RETRY_S)

    def _read(self) -> None:
        while not self._stop.is_set():
            sample = self._device.read(READ_S)
            if sample is not None:
                self._take(sample)

    def _become(self, *, connected: bool, error: str) -> None:
        old = self.state
        if (old.connected, old.error) != (connected, error):
            self.state = DeviceState(old.name, connected, error, now_us(), old.opened + connected)
            self._changed()
