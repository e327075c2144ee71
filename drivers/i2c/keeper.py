"""Keeps the chips of a bus at work: sets them up, tries again, gives up for a while, notices resets and stuck lines."""

import errno
from collections.abc import Callable, Sequence
from time import monotonic
from typing import TypeVar

from . import words
from .member import Member
from .node import NOBODY, Node, Query
from .recognising import ImpostorError, read_back, set_up, whats_there
from .routes import Routes, place

T = TypeVar("T")

TRIES = 3
# An absent chip is tried again so often: it shall be back, and set up, within a second of its cable's return. What is
# found again and again not to be the chip it should be is tried less often, for trying writes to it.
RETRY_S = 0.9
RETRY_IMPOSTOR_S = 10.0


class Keeper:
    """The chips of one bus.

    `revision` changes whenever a chip comes or goes; `due` is when `attend` wants to be called next; `trouble` says
    what is wrong with the bus as a whole, "" for nothing. Every method that touches the wire raises DeviceError if the
    device node is gone, and nothing else.
    """

    def __init__(self, node: Node, members: Sequence[Member], check_every_s: float) -> None:
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
        self._node.plain_i2c = self._node.offers_i2c
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

    def attempt(self, member: Member, action: Callable[[], T], tries: int = TRIES) -> T | None:
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

    def check(self, member: Member) -> None:
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
            if code not in words.STUCK:  # no acknowledge, by whatever errno this adapter tells it
                self.trouble = ""
                return
        self.trouble = words.stuck(self._node.device, code)
        for member in self._members:
            member.present = False
            member.last_error = self.trouble
            member.due = monotonic()
        self._changed()

    def _in_order(self, member: Member) -> bool:
        """Return whether the chip holds its registers. A mux that connects something else is set again."""
        if member.route and not self.routes.holds():
            named = place(self._node.device, "tca9548a", member.route.mux, None)
            member.blame(f"{named} had lost its channel (a reset, or another program): it was selected again")
            self.routes.forget()
            self.routes.select(member.route)
        watched = member.watched
        if watched is None or watched.holds(read_back(self._node, member.chip, watched)):
            return True
        member.blame(f"{member.named} had lost its registers (was its supply off for a moment?): it was set up again")
        return False

    def _bring_up(self, member: Member, tries: int) -> None:
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
            self._changed()

    def _set_up(self, member: Member) -> bool:
        self._node.claim(member.chip.address)
        set_up(self._node, member.chip, member.used)
        return True

    def _refuse(self, member: Member) -> None:
        self.feel()  # a line held low answers for every chip
        if self.trouble:
            return
        there = whats_there(self._node, member.chip.address)
        found = f"{member.named} is not there, but {there}: check the harness and the chip's address pins"
        # The first time it may also have been a supply or a contact that came and went during the set-up.
        member.due = monotonic() + (RETRY_IMPOSTOR_S if found == member.last_error else RETRY_S)
        member.blame(found)

    def _note(self, member: Member, error: OSError) -> None:
        """Blame the mux where it failed, else the chip."""
        named = member.named
        if member.route and self.routes.selected != member.route and self.routes.mux is not None:
            named = place(self._node.device, "tca9548a", self.routes.mux, None)
        member.blame(words.failure(named, error.errno))

    def _lose(self, member: Member, error: OSError) -> None:
        member.present = False
        member.due = monotonic() + RETRY_S
        self._changed()
        if self.trouble:
            return
        if error.errno == errno.ENODEV:  # nobody there, on some adapters; on most, the adapter itself is gone
            self._renew()
        elif error.errno not in words.NOBODY_THERE:
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
