"""Every device of a harness, each kept open in a separate thread, and their newest frames, joined."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from threading import Condition, Event, Thread
from typing import TYPE_CHECKING, Self

from msgspec import Struct
from msgspec.structs import replace

from thenar.drivers.errors import DeviceError, SettingError

from ..frames import GloveFrame, Mask, Newest, SwitchFrame, now_us
from ..harness.wiring import Harness
from ..published import Count, DeviceHealth
from ..scanning.scanmap import ScanMap
from ..sources.base import Source, slowest_us, sources_of
from ..taxels import calibration_of

if TYPE_CHECKING:
    from logging import Logger

# The state of a device before the first attempt to open it.
NOT_YET = "not opened yet"
# Recovery is promised within a second of the cable's return; opening a CyberGlove takes a part of that.
RETRY_S = 0.2
# How long a reading may block before its thread checks whether it should stop.
READ_S = 0.1
# How long closing waits for a reading, or for an opening: a name's or a radio's search may take longer.
_CLOSE_S = 5.0
# Frames that arrived and were not taken yet; a loop that stalls for longer loses the oldest.
_MOST_WAITING = 4096
# How long to wait for something new if there is no device with a period.
_PATIENCE_US = 100_000
# A run looks this often whether it should end, however slow its devices are.
_LONGEST_WAIT_US = 250_000

# Faults of one device that are logged with their traces; changing messages must not fill a disk.
_MOST_FAULTS = 20


class DeviceThread:
    """Keeps a source open and passes every frame to `take`, in a separate thread, until it is closed.

    A SettingError ends it unless the device was open before: `failure` then holds it, for callers that wait. `opened`
    says how often it was opened, `faults` how often an exception ended its reading that only a bug in the program
    explains.
    """

    def __init__(
        self,
        name: str,
        device: Source,
        take: Callable[[SwitchFrame | GloveFrame], None],
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        """changed() is called whenever the state changes."""
        self.state = DeviceHealth(name, connected=False, error=NOT_YET)
        self.opened = self.faults = 0
        self.failure: SettingError | None = None
        self._device, self._take, self._changed = device, take, changed
        self._logged: set[str] = set()
        self._stop = Event()
        self._thread = Thread(target=self._keep, name=f"thenar {name}", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Make it end soon."""
        self._stop.set()

    def close(self) -> None:
        """End it: returns once the device is closed. One that is still being opened after 5 s is left to the thread."""
        self.stop()
        if self._thread.is_alive():
            self._thread.join(_CLOSE_S)

    def _keep(self) -> None:
        while not self._stop.is_set():
            try:
                self._device.open()
                self._become(connected=True, error="")
                while not self._stop.is_set():
                    frame = self._device.read(READ_S)
                    if frame is not None:
                        self._take(frame)
            except SettingError as wrong:
                self._become(connected=False, error=str(wrong))
                # It worked before, so it can again: only a garbled reply can say otherwise.
                if not self.opened:
                    self.failure = wrong
                    return
            except DeviceError as wrong:
                self._become(connected=False, error=str(wrong))
            except BaseException as fault:  # a bug, or a call of sys.exit, must leave no dead thread that looks alive
                self._blame(f"{type(fault).__name__}: {fault}")
            finally:
                self._let_go()
            self._stop.wait(RETRY_S)

    def _let_go(self) -> None:
        try:
            self._device.close()
        except OSError as gone:
            self._log().debug("%s: closing it: %s", self.state.name, gone)
        except BaseException as fault:  # as above
            self._blame(f"{type(fault).__name__}: {fault}")

    def _blame(self, fault: str) -> None:
        """Count an exception, and log it with its trace, once: a device that opens and then fails does so for hours."""
        if fault not in self._logged and len(self._logged) < _MOST_FAULTS:
            self._logged.add(fault)
            self._log().exception("%s: a bug in the program", self.state.name)
        self.faults += 1
        self._become(connected=False, error=fault)

    def _log(self) -> "Logger":
        from logging import getLogger  # a thread of a device waits for it, not the import of a glove

        return getLogger("thenar")

    def _become(self, *, connected: bool, error: str) -> None:
        old = self.state
        if (old.connected, old.error) != (connected, error):
            self._log().info("%s: %s", old.name, error or "connected")
            self.opened += connected
            self.state = DeviceHealth(old.name, connected, error)
            self._changed()


class Snapshot(Struct, frozen=True):
    """The newest frames at `time_us`; all that arrived since the last time; the glove's record if it is current."""

    time_us: int
    switches: SwitchFrame | None
    glove: GloveFrame | None
    arrived: tuple[SwitchFrame | GloveFrame, ...]
    measured: GloveFrame | None


class FrameBuffer:
    """Frames from the threads of the devices, for the one thread that takes them.

    Each part reads some of the switches: `owned` are those of each, which share no switch; switches that no part owns
    are always lost. The shared state of these methods is only accessed under the condition, except `glove`, one
    attribute of which may be read without it, and `overflowed`: each is a value that is replaced whole.

    switches    the newest frame of all parts together; None before the first
    glove       the newest record of the CyberGlove
    overflowed  frames that nobody took in time: a recording lacks them
    """

    def __init__(self, switches: int, owned: Sequence[Mask]) -> None:
        self.switches: SwitchFrame | None = None
        self.glove = Newest[GloveFrame]()
        self.overflowed = 0
        self._parts = tuple((mask, Newest[SwitchFrame]()) for mask in owned)
        self._nobodys = (1 << switches) - 1 & ~sum(owned)
        self._joined_until_us = -1
        self._waiting: deque[SwitchFrame | GloveFrame] = deque(maxlen=_MOST_WAITING)
        self._condition = Condition()

    def put_switches(self, part: int, frame: SwitchFrame, longest_us: int) -> None:
        """Add a frame of part number `part`, which is current for longest_us from its reading time."""
        with self._condition:
            now = now_us()
            self._parts[part][1].take(frame, now, longest_us)
            self.switches = self._joined(now)
            if self.switches is not None:
                self._wait_for_taking(self.switches)
            self._condition.notify_all()

    def put_glove(self, frame: GloveFrame, longest_us: int) -> None:
        """Add a record of the glove, which is current for longest_us from its reading time."""
        with self._condition:
            self.glove.take(frame, now_us(), longest_us)
            self._wait_for_taking(frame)
            self._condition.notify_all()

    def take(self, patience_us: Callable[[], int] | None = None, at_most_us: int = _LONGEST_WAIT_US) -> Snapshot:
        """Return the newest frames, and all that arrived since the last call.

        If nothing has arrived, wait for it, but no longer than at_most_us: until the first of the current frames
        expires; if none is current, for patience_us(). Without patience_us, do not wait. A part of the switches that
        has stopped sending is lost from then on, whether or not another one sends.
        """
        with self._condition:
            now = now_us()
            if now > self._joined_until_us:
                self._lose(now)
            if patience_us is not None and not self._waiting:
                left_us = self.fresh_for_us(now)
                self._condition.wait(min(patience_us() if left_us is None else left_us, at_most_us) / 1e6)
                now = now_us()
                if now > self._joined_until_us:
                    self._lose(now)
            arrived = tuple(self._waiting)
            self._waiting.clear()
            glove = self.glove
            return Snapshot(now, self.switches, glove.frame, arrived, glove.frame if now <= glove.expires_us else None)

    def fresh_for_us(self, now_us: int) -> int | None:
        """Return the microseconds until the first of the current frames expires; None: none is current. `take` calls it
        under the condition.
        """
        switches_us, glove_us = self._joined_until_us, self.glove.expires_us
        if switches_us < now_us:
            return glove_us + 1 - now_us if glove_us >= now_us else None
        return (switches_us if glove_us < now_us else min(switches_us, glove_us)) + 1 - now_us

    def _joined(self, now_us: int) -> SwitchFrame | None:
        """Return the newest of all parts as one frame, or None before the first.

        The switches of a part are lost once its frame has expired, all of them when all have. The time is that of the
        newest frame, expired or not: it never falls when a part does. It stays so until a current frame expires.
        """
        fresh: list[SwitchFrame] = []
        time_us, silent, until_us = -1, self._nobodys, -1
        for owned, newest in self._parts:
            frame = newest.frame
            if frame is not None and frame.time_us > time_us:
                time_us = frame.time_us
            if frame is None or now_us > newest.expires_us:
                silent |= owned
                continue
            until_us = newest.expires_us if not fresh else min(until_us, newest.expires_us)
            fresh.append(frame)
        self._joined_until_us = until_us
        if len(fresh) == 1 and not silent:
            return fresh[0]
        if time_us < 0:
            return None
        closed = lost = 0
        taxels = _joined_taxels([frame.taxels for frame in fresh if frame.taxels is not None])
        for frame in fresh:
            closed, lost = closed | frame.closed, lost | frame.lost
        return SwitchFrame(time_us, closed, lost | silent, taxels=taxels)

    def _lose(self, now_us: int) -> None:
        """Join the parts again, if one may have stopped sending: that is reported once."""
        switches = self._joined(now_us)
        if switches is not None and switches != self.switches:
            self.switches = switches
            self._wait_for_taking(switches)

    def _wait_for_taking(self, frame: SwitchFrame | GloveFrame) -> None:
        self.overflowed += len(self._waiting) == _MOST_WAITING
        self._waiting.append(frame)


def _joined_taxels(parts: Sequence[tuple[int | None, ...]]) -> tuple[int | None, ...] | None:
    """Return the codes of the devices, each with its own taxels; None if no device has any."""
    if len(parts) < 2:
        return parts[0] if parts else None
    return tuple(next((code for code in codes if code is not None), None) for codes in zip(*parts, strict=True))


class Sources:
    """The devices of `harness`, from entering this context to leaving it.

    switch_names  the wanted switches, in the order of the frames' bits: a build's kept switches
    scan          the ports of the I2C expanders to read, in order
    sensors       the joints' sensors in use by a build; None: there is no build, everything is in use

    changed       whether a device came, went or failed differently since this was last set to False

    take(at_most_us) returns the newest frames, and all that arrived since the last call. It waits for something as long
    as the newest frames stay fresh, and for a period where none is, but no longer than at_most_us, if that is given.
    """

    def __init__(
        self,
        harness: Harness,
        switch_names: Sequence[str],
        scan: ScanMap,
        sensors: Sequence[str] | None = None,
    ) -> None:
        self._devices = sources_of(harness, switch_names, scan, calibration_of(harness.taxel_settings))
        self._arrivals = FrameBuffer(len(switch_names), [device.owned for device in self._devices])
        if sensors is not None:
            for device in self._devices:
                device.read_only(sensors)
        self.take: Callable[..., Snapshot] = partial(self._arrivals.take, self._patience_us)
        self.changed = True
        self._keepers = [
            DeviceThread(source.name, source, self._taking(part, source), self._change)
            for part, source in enumerate(self._devices)
        ]

    def _change(self) -> None:
        self.changed = True

    def _patience_us(self) -> int:
        return min(filter(None, (self.switch_period_us, self.glove_period_us)), default=_PATIENCE_US)

    @property
    def switch_period_us(self) -> int | None:
        """The longest expected period of switches and taxels; None if nothing reads them."""
        return slowest_us(device for device in self._devices if device.owned or device.taxels)

    @property
    def glove_period_us(self) -> int | None:
        """The longest expected period of the glove; None if there is none."""
        return slowest_us(device for device in self._devices if device.reads_joints)

    def devices(self) -> tuple[DeviceHealth, ...]:
        """Return the state of every device."""
        return tuple(keeper.state for keeper in self._keepers)

    def health(self) -> tuple[DeviceHealth, ...]:
        """Return the state of every device, with its driver's counters."""
        return tuple(
            replace(
                state,
                error=state.error or device.fault_message(),
                counts=(*device.counts(), Count("program faults", keeper.faults)),
            )
            for state, keeper, device in zip(self.devices(), self._keepers, self._devices, strict=True)
        )

    @property
    def overflowed(self) -> int:
        """The number of frames that arrived and were not taken in time; a recording lacks them."""
        return self._arrivals.overflowed

    def raise_settings(self) -> None:
        """Raise the SettingError of a device that can never work as configured in glove.toml."""
        for keeper in self._keepers:
            if keeper.failure is not None:
                raise keeper.failure

    def __enter__(self) -> Self:
        for keeper in self._keepers:
            keeper.start()
        return self

    def __exit__(self, *_: object) -> None:
        # All are stopped first: each may take as long as one reading, or opening.
        for keeper in self._keepers:
            keeper.stop()
        for keeper in self._keepers:
            keeper.close()

    def _taking(self, part: int, source: Source) -> Callable[[SwitchFrame | GloveFrame], None]:
        """Return a function that takes the frames of a source, of either kind."""

        def take(frame: SwitchFrame | GloveFrame) -> None:
            if isinstance(frame, GloveFrame):
                self._arrivals.put_glove(frame, source.longest_us)
            else:
                self._arrivals.put_switches(part, frame, source.longest_us)

        return take
