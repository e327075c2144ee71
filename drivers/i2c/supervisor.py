"""Supervises the chips of a bus: set-up, retries and pauses, detection of resets and stuck lines."""

import errno
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from time import monotonic
from typing import TypeVar

from ..logs import logger
from .chips import CHIPS, Chip, Write
from .node import NOBODY, NOBODY_THERE, STUCK, BatchMode, DeviceNode, Query, failure, stuck
from .tca9548a import control

_LOG = logger(__name__)
T = TypeVar("T")

TRIES = 3
# Retry period of an absent chip: it must be back, and set up, within a second of its cable's return. A device that
# proves repeatedly to be the wrong chip is retried less often, since each attempt writes to it.
RETRY_S = 0.9
RETRY_IMPOSTOR_S = 10.0

# This many missing acknowledgements in a row make a mux count as gone: a glitch may cause one.
_NAKS = 3


@dataclass(frozen=True, slots=True)
class Route:
    """A channel of the mux at address `mux`."""

    mux: int
    channel: int


def place(device: str, what: str, address: int, route: Route | None) -> str:
    """Return a name of the chip by its location."""
    behind = f" (channel {route.channel} of the tca9548a at 0x{route.mux:02X})" if route else ""
    return f"{device}: the {what} at 0x{address:02X}{behind}"


class Routes:
    """The muxes of a bus. At most one channel of all muxes is connected; chips off the muxes are always reachable.

    The selection is remembered, and forgotten at any failure behind a mux: after a reset of the mux the chips behind it
    do not acknowledge, and the next attempt selects again.

    mux  the address of the last used mux
    """

    def __init__(self, node: DeviceNode, muxes: Iterable[int]) -> None:
        self._node = node
        self._connected = set(muxes)  # those that may have a channel on: initially all
        self.selected: Route | None = None
        self.mux: int | None = None

    def select(self, route: Route | None) -> None:
        """Connect `route` alone, unless it already is. On failure nothing is selected, and OSError is raised."""
        if route is None or route == self.selected:
            return
        self.selected = None
        for other in sorted(self._connected - {route.mux}):
            self._release(other)
        self._connected.add(route.mux)
        self._tell(route.mux, route.channel)
        self.selected = route

    def holds(self) -> bool:
        """Read the mux's register back; return whether the selection is still connected. Raises OSError."""
        selected = self.selected
        if selected is None:
            return True
        return self._node.query(Query(selected.mux, b"", 1)) == control(selected.channel)

    def forget(self) -> None:
        """Forget the selection, so that the next access selects again."""
        self.selected = None

    def _release(self, mux: int) -> None:
        """Disconnect all channels of a mux. If it is gone, so are the chips behind it.

        Raises OSError if it may still be connected: its chips would respond together with those of the other mux.
        """
        for left in reversed(range(_NAKS)):
            try:
                self._tell(mux, None)
            except OSError as error:
                if error.errno not in NOBODY_THERE:
                    raise
                if not left:
                    return
            else:
                self._connected.discard(mux)
                return

    def _tell(self, mux: int, channel: int | None) -> None:
        self.mux = mux
        self._node.write(mux, control(channel))


def set_up(node: DeviceNode, chip: Chip, address: int, used: frozenset[int]) -> bool:
    """Write the chip's registers and read them back; return whether it is the expected chip. Raises OSError."""
    for write in chip.setup(used):
        node.write(address, write.data)
        if write.expect and not write.holds(read_back(node, chip, address, write)):
            return False
    return True


def read_back(node: DeviceNode, chip: Chip, address: int, write: Write) -> bytes:
    """Return the bytes at the location that `write` wrote."""
    return node.query(Query(address, write.data[:1] if chip.registers else b"", len(write.expect)))


def identify_chip(node: DeviceNode, address: int) -> str:
    """Describe the device at an address: the first kind whose set-up succeeds, which leaves its pins inputs.

    Kinds without registers come last, since probing for registers drives their pins.
    """
    for chip in sorted(CHIPS.values(), key=lambda chip: chip.registers, reverse=True):
        with suppress(OSError):
            if address in chip.addresses and set_up(node, chip, address, frozenset()):
                return f"something that behaves like a {chip.name}"
    return "something unknown"


@dataclass(eq=False, slots=True)
class PlacedChip:
    """A chip, its location, the numbers of its used pins, and its health, which only its supervisor changes.

    route  the mux's channel that it is on; None: it is directly on the bus

    `errors` counts failures, including those that a retry fixed; `last_error` stays. `due` is the time of its next
    check; `checked` counts its checks; `zeros` is their number when zeros from it were last confirmed.
    """

    chip: Chip
    address: int
    used: frozenset[int]
    route: Route | None = None
    present: bool = False
    errors: int = 0
    last_error: str = ""
    due: float = 0.0
    checked: int = 0
    zeros: int = -1

    def blame(self, error: str) -> None:
        """Count a failure."""
        self.errors += 1
        self.last_error = error


class ChipSupervisor:
    """The chips of one bus.

    `revision` changes whenever a chip comes or goes; `due` is the time of the next call of `attend`; `fault_message`
    describes a fault of the whole bus, or is "". Every method that uses the wire raises DeviceError if the device node
    is gone, and no other error.
    """

    def __init__(self, node: DeviceNode, chips: Sequence[PlacedChip], check_every_s: float) -> None:
        self.node, self.chips = node, tuple(chips)
        self._check_every_s = check_every_s
        self.routes = self._unknown_routes()
        self.revision = 0
        self.due = 0.0
        self.fault_message = ""

    def begin(self) -> None:
        """Open the node and set up every chip."""
        self._renew()
        self.routes = self._unknown_routes()
        self.node.way = BatchMode.CHANNEL
        self.fault_message = ""
        for member in self.chips:
            member.present = False
        for number, member in enumerate(self.chips):
            if not self.fault_message:
                self._bring_up(member, TRIES)
            if member.present:  # spread checks, so that no scan waits for more than one
                member.due = monotonic() + self._check_every_s * (number + 1) / len(self.chips)
        self._schedule()

    def attend(self) -> None:
        """Check the chip that has waited longest, or test whether it is back. A stuck bus comes first."""
        if self.fault_message:
            self._unstick()
        elif self.chips:
            member = min(self.chips, key=lambda member: member.due)
            if member.present:
                member.due = monotonic() + self._check_every_s
                self.check(member)
            else:
                if not any(other.present for other in self.chips):
                    self._renew()  # not every adapter returns ENODEV once unplugged: test its node
                self._bring_up(member, 1)
        self._schedule()

    def attempt(self, member: PlacedChip, action: Callable[[], T], tries: int = TRIES) -> T | None:
        """Run `action` on a chip behind its route, up to `tries` times; then mark it absent and return None."""
        for left in reversed(range(tries)):
            try:
                self.routes.select(member.route)
                return action()
            except OSError as error:
                self._note(member, error)
                self.routes.forget()
                if error.errno in (errno.ETIMEDOUT, errno.EBUSY):  # each may last a second: retry no more
                    self.check_bus_stuck()
                if self.fault_message or not left:
                    self._lose(member, error)
                    break
        return None

    def check(self, member: PlacedChip) -> None:
        """Read back the registers that a reset of the chip or of its mux would have lost, and restore them."""
        member.checked += 1
        fine = self.attempt(member, lambda: self._in_order(member))
        if fine is False:
            self._bring_up(member, TRIES)

    def check_bus_stuck(self) -> None:
        """Detect a stuck bus: an unused address must not be acknowledged."""
        code: int | None = None
        try:
            self.node.query(Query(NOBODY, b"", 1))
        except OSError as error:
            code = error.errno
            if code not in STUCK:  # no acknowledge, whichever errno this adapter uses for it
                if self.fault_message:
                    _LOG.warning("%s: the bus is free again", self.node.device)
                self.fault_message = ""
                return
        if not self.fault_message:
            _LOG.warning("%s", stuck(self.node.device, code))
        self.fault_message = stuck(self.node.device, code)
        for member in self.chips:
            member.present = False
            member.last_error = self.fault_message
            member.due = monotonic()
        self._changed()

    def _in_order(self, member: PlacedChip) -> bool:
        """Return whether the chip still has its register values. A mux with another selection is set again."""
        if member.route and not self.routes.holds():
            named = place(self.node.device, "tca9548a", member.route.mux, None)
            member.blame(f"{named} had lost its channel (a reset, or another program): it was selected again")
            self.routes.forget()
            self.routes.select(member.route)
        watched = member.chip.watched(member.used)
        if watched is None or watched.holds(read_back(self.node, member.chip, member.address, watched)):
            return True
        named = self._named(member)
        member.blame(f"{named} had lost its registers (was its supply off for a moment?): it was set up again")
        return False

    def _bring_up(self, member: PlacedChip, tries: int) -> None:
        """Set up a chip, which is present then. If another device is there, record which."""
        was = member.present
        member.present = False
        for left in reversed(range(tries)):
            if self.fault_message:
                break
            expected = self.attempt(member, lambda: self._set_up(member), 1)
            member.present = expected is True
            if expected is False and not left:
                self._refuse(member)
            if member.present:
                member.due = monotonic() + self._check_every_s
                break
        if was or member.present:
            _LOG.info("%s is %s", self._named(member), "set up" if member.present else "gone")
            self._changed()

    def _set_up(self, member: PlacedChip) -> bool:
        self.node.claim(member.address)
        return set_up(self.node, member.chip, member.address, member.used)

    def _refuse(self, member: PlacedChip) -> None:
        self.check_bus_stuck()  # a line held low looks like a reply of every chip
        if self.fault_message:
            return
        there = identify_chip(self.node, member.address)
        found = f"{self._named(member)} is not there, but {there}: check the harness and the chip's address pins"
        # The first failure may also come from an intermittent supply or contact during the set-up.
        member.due = monotonic() + (RETRY_IMPOSTOR_S if found == member.last_error else RETRY_S)
        member.blame(found)

    def _note(self, member: PlacedChip, error: OSError) -> None:
        """Count the failure for the mux if it failed, else for the chip."""
        named = self._named(member)
        if member.route and self.routes.selected != member.route and self.routes.mux is not None:
            named = place(self.node.device, "tca9548a", self.routes.mux, None)
        member.blame(failure(named, error.errno))

    def _lose(self, member: PlacedChip, error: OSError) -> None:
        if member.present:
            _LOG.warning("%s", member.last_error)
        member.present = False
        member.due = monotonic() + RETRY_S
        self._changed()
        if self.fault_message:
            return
        if error.errno == errno.ENODEV:  # no device there, on some adapters; on most, the adapter itself is gone
            self._renew()
        elif error.errno not in NOBODY_THERE:
            self.check_bus_stuck()

    def _unstick(self) -> None:
        """Reopen the node; then reads that clock SCL free a chip that waits within a byte."""
        self._renew()
        self.check_bus_stuck()
        for member in self.chips:
            member.due = monotonic() + (RETRY_S if self.fault_message else 0.0)

    def _named(self, member: PlacedChip) -> str:
        return place(self.node.device, member.chip.name, member.address, member.route)

    def _unknown_routes(self) -> Routes:
        return Routes(self.node, {member.route.mux for member in self.chips if member.route})

    def _renew(self) -> None:
        self._changed()
        self.routes.forget()
        self.node.open()

    def _changed(self) -> None:
        self.revision += 1
        self._schedule()

    def _schedule(self) -> None:
        self.due = min((member.due for member in self.chips), default=float("inf"))
