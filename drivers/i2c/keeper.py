"""Keeps the chips of a bus at work: sets them up, tries again, gives up for a while, notices resets and stuck lines."""

import errno
import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import TypeVar

from .chips import CHIPS, Chip, Write
from .node import NOBODY, NOBODY_THERE, STUCK, Node, Query, failure, stuck
from .tca9548a import control

_LOG = logging.getLogger(__name__)
T = TypeVar("T")

TRIES = 3
# An absent chip is tried again so often: it shall be back, and set up, within a second of its cable's return. What is
# found again and again not to be the chip it should be is tried less often, for trying writes to it.
RETRY_S = 0.9
RETRY_IMPOSTOR_S = 10.0

# So often a mux must leave its address unacknowledged before it counts as gone: a glitch may swallow one.
_NAKS = 3


@dataclass(frozen=True, slots=True)
class Route:
    """A channel of the mux at address `mux`."""

    mux: int
    channel: int


def place(device: str, what: str, address: int, route: Route | None) -> str:
    """Name a chip by where it is."""
    behind = f" (channel {route.channel} of the tca9548a at 0x{route.mux:02X})" if route else ""
    return f"{device}: the {what} at 0x{address:02X}{behind}"


class Routes:
    """The muxes of a bus. Only one channel of them all is connected at a time; chips off the muxes are always reached.

    What was selected is remembered, and forgotten at any failure behind a mux: a mux that was reset acknowledges
    nothing for the chips behind it, and the next try selects again.

    mux  the address of the mux that was spoken to last
    """

    def __init__(self, node: Node, muxes: Iterable[int]) -> None:
        self._node = node
        self._connected = set(muxes)  # those that may have a channel on: all, until they were seen to
        self.selected: Route | None = None
        self.mux: int | None = None

    def select(self, route: Route | None) -> None:
        """Connect `route`, and nothing else, unless it is connected. Raises OSError, with nothing selected, if not."""
        if route is None or route == self.selected:
            return
        self.selected = None
        for other in sorted(self._connected - {route.mux}):
            self._release(other)
        self._connected.add(route.mux)
        self._tell(route.mux, route.channel)
        self.selected = route

    def holds(self) -> bool:
        """Read the mux's register back: is what was selected still connected? Raises OSError."""
        selected = self.selected
        if selected is None:
            return True
        return self._node.query(Query(selected.mux, b"", 1)) == control(selected.channel)

    def forget(self) -> None:
        """Select again next time."""
        self.selected = None

    def _release(self, mux: int) -> None:
        """Disconnect all channels of a mux. One that is gone takes with it what is behind it.

        Raises OSError where it may still be connected: its chips would answer together with those of the other mux.
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


class ImpostorError(Exception):
    """What answers at an address is not the chip that should be there."""


def set_up(node: Node, chip: Chip, address: int, used: frozenset[int]) -> None:
    """Write the chip's registers and read them back. Raises OSError of a transfer, ImpostorError of a wrong answer."""
    for write in chip.setup(used):
        node.write(address, write.data)
        if write.expect and not write.holds(read_back(node, chip, address, write)):
            raise ImpostorError


def read_back(node: Node, chip: Chip, address: int, write: Write) -> bytes:
    """Return the bytes that stand where `write` put its own."""
    return node.query(Query(address, write.data[:1] if chip.registers else b"", len(write.expect)))


def whats_there(node: Node, address: int) -> str:
    """Return, in words, what answers at an address: the first kind whose set-up holds, which leaves its pins inputs.

    Kinds without registers come last, for what is written to look for registers drives their pins.
    """
    for chip in sorted(CHIPS.values(), key=lambda chip: chip.registers, reverse=True):
        if address in chip.addresses and _behaves_like(node, chip, address):
            return f"something that behaves like a {chip.name}"
    return "something unknown"


def _behaves_like(node: Node, chip: Chip, address: int) -> bool:
    try:
        set_up(node, chip, address, frozenset())
    except (OSError, ImpostorError):
        return False
    return True


@dataclass(eq=False, slots=True)
class PlacedChip:
    """A chip in its place on the bus at `device`, and how it is doing, which its keeper alone changes.

    `errors` counts what failed, retries that helped included; `last_error` stays. `due` is when it is seen to next;
    `checked` counts its checks; `zeros` is how many there were when zeros of it were last found right.
    """

    device: str
    chip: Chip
    address: int
    used: frozenset[int]
    route: Route | None
    present: bool = False
    errors: int = 0
    last_error: str = ""
    due: float = 0.0
    checked: int = 0
    zeros: int = -1

    @property
    def watched(self) -> Write | None:
        """What a reset would lose."""
        return self.chip.watched(self.used)

    @property
    def named(self) -> str:
        """The chip and where it is, for messages."""
        return place(self.device, self.chip.name, self.address, self.route)

    def blame(self, error: str) -> None:
        """Count a failure."""
        self.errors += 1
        self.last_error = error


class Keeper:
    """The chips of one bus.

    `revision` changes whenever a chip comes or goes; `due` is when `attend` wants to be called next; `trouble` says
    what is wrong with the bus as a whole, "" for nothing. Every method that touches the wire raises DeviceError if the
    device node is gone, and nothing else.
    """

    def __init__(self, node: Node, members: Sequence[PlacedChip], check_every_s: float) -> None:
        self._node = node
        self._members = members
        self._check_every_s = check_every_s
        self.routes = self._unknown_routes()
        self.revision = 0
        self.due = 0.0
        self.trouble = ""

    def begin(self) -> None:
        """Open the node and set up every chip."""
        self._renew()
        self.routes = self._unknown_routes()
        self._node.find_way()
        self.trouble = ""
        for member in self._members:
            member.present = False
        for number, member in enumerate(self._members):
            if not self.trouble:
                self._bring_up(member, TRIES)
            if member.present:  # checks are spread, so that no scan waits for more than one
                member.due = monotonic() + self._check_every_s * (number + 1) / len(self._members)
        self._schedule()

    def attend(self) -> None:
        """See to the one chip that has waited longest: check it, or try whether it is back. A stuck bus comes first."""
        if self.trouble:
            self._unstick()
        elif self._members:
            member = min(self._members, key=lambda member: member.due)
            if member.present:
                member.due = monotonic() + self._check_every_s
                self.check(member)
            else:
                if not any(other.present for other in self._members):
                    self._renew()  # not every adapter says ENODEV once it is unplugged: its node tells
                self._bring_up(member, 1)
        self._schedule()

    def attempt(self, member: PlacedChip, action: Callable[[], T], tries: int = TRIES) -> T | None:
        """Do something with a chip behind its route, up to three times; then it is absent, and None is returned."""
        for left in reversed(range(tries)):
            try:
                self.routes.select(member.route)
                return action()
            except OSError as error:
                self._note(member, error)
                self.routes.forget()
                if error.errno in (errno.ETIMEDOUT, errno.EBUSY):  # each may last a second: no more of them than needed
                    self.feel()
                if self.trouble or not left:
                    self._lose(member, error)
                    break
        return None

    def check(self, member: PlacedChip) -> None:
        """Read back what a reset of the chip or of its mux would have lost, and restore it."""
        member.checked += 1
        fine = self.attempt(member, lambda: self._in_order(member))
        if fine is False:
            self._bring_up(member, TRIES)

    def feel(self) -> None:
        """Find out whether the bus is stuck: an address that nobody has must be acknowledged by nobody."""
        code: int | None = None
        try:
            self._node.query(Query(NOBODY, b"", 1))
        except OSError as error:
            code = error.errno
            if code not in STUCK:  # no acknowledge, by whatever errno this adapter tells it
                if self.trouble:
                    _LOG.warning("%s: the bus is free again", self._node.device)
                self.trouble = ""
                return
        if not self.trouble:
            _LOG.warning("%s", stuck(self._node.device, code))
        self.trouble = stuck(self._node.device, code)
        for member in self._members:
            member.present = False
            member.last_error = self.trouble
            member.due = monotonic()
        self._changed()

    def _in_order(self, member: PlacedChip) -> bool:
        """Return whether the chip holds its registers. A mux that connects something else is set again."""
        if member.route and not self.routes.holds():
            named = place(self._node.device, "tca9548a", member.route.mux, None)
            member.blame(f"{named} had lost its channel (a reset, or another program): it was selected again")
            self.routes.forget()
            self.routes.select(member.route)
        watched = member.watched
        if watched is None or watched.holds(read_back(self._node, member.chip, member.address, watched)):
            return True
        member.blame(f"{member.named} had lost its registers (was its supply off for a moment?): it was set up again")
        return False

    def _bring_up(self, member: PlacedChip, tries: int) -> None:
        """Set a chip up; it is present then. If something else is there, say what."""
        was = member.present
        member.present = False
        for left in reversed(range(tries)):
            if self.trouble:
                break
            try:
                member.present = self.attempt(member, lambda: self._set_up(member), 1) is True
            except ImpostorError:
                if not left:
                    self._refuse(member)
            if member.present:
                member.due = monotonic() + self._check_every_s
                break
        if was or member.present:
            _LOG.info("%s is %s", member.named, "set up" if member.present else "gone")
            self._changed()

    def _set_up(self, member: PlacedChip) -> bool:
        self._node.claim(member.address)
        set_up(self._node, member.chip, member.address, member.used)
        return True

    def _refuse(self, member: PlacedChip) -> None:
        self.feel()  # a line held low answers for every chip
        if self.trouble:
            return
        there = whats_there(self._node, member.address)
        found = f"{member.named} is not there, but {there}: check the harness and the chip's address pins"
        # The first time it may also have been a supply or a contact that came and went during the set-up.
        member.due = monotonic() + (RETRY_IMPOSTOR_S if found == member.last_error else RETRY_S)
        member.blame(found)

    def _note(self, member: PlacedChip, error: OSError) -> None:
        """Blame the mux where it failed, else the chip."""
        named = member.named
        if member.route and self.routes.selected != member.route and self.routes.mux is not None:
            named = place(self._node.device, "tca9548a", self.routes.mux, None)
        member.blame(failure(named, error.errno))

    def _lose(self, member: PlacedChip, error: OSError) -> None:
        if member.present:
            _LOG.warning("%s", member.last_error)
        member.present = False
        member.due = monotonic() + RETRY_S
        self._changed()
        if self.trouble:
            return
        if error.errno == errno.ENODEV:  # nobody there, on some adapters; on most, the adapter itself is gone
            self._renew()
        elif error.errno not in NOBODY_THERE:
            self.feel()

    def _unstick(self) -> None:
        """Open the node anew; then the reads of `feel` clock SCL, which frees a chip that waits amid a byte."""
        self._renew()
        self.feel()
        for member in self._members:
            member.due = monotonic() + (RETRY_S if self.trouble else 0.0)

    def _unknown_routes(self) -> Routes:
        return Routes(self._node, {member.route.mux for member in self._members if member.route})

    def _renew(self) -> None:
        self._changed()
        self.routes.forget()
        self._node.open()

    def _changed(self) -> None:
        self.revision += 1
        self._schedule()

    def _schedule(self) -> None:
        self.due = min((member.due for member in self._members), default=float("inf"))
