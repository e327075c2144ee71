"""Debouncing: a press is reported as soon as it is read, a release once the contact has been open long enough.

A snap-action switch bounces for up to 3 ms when it closes and 8 ms when it opens (Panasonic EVQPL; other tact switches
10 ms). Presses are eager, with a lockout; releases are deferred, as is usual where a press must not wait (QMK's
`asym_eager_defer_pk`). All switches are processed together as bits of one integer; those that change together share
timers.
"""

from .errors import SettingError

Mask = int


class Debouncer:
    """Debounced switch states from raw readings.

    press_lockout_us  readings of a switch are ignored for this time after its press
    release_us        a switch opens once all its readings were open for this time. A release is not deferred to a scan
                      that comes after this time: if scans are further apart than release_us / 2, a release takes fewer
                      than two scans. Closed readings within release_us of the opening count as bounce and are ignored.

    A switch that was not read for twice the longer of both begins anew, as open: its bounces are over, and it may have
    opened and closed since.

    Raises SettingError for a negative time.
    """

    def __init__(self, press_lockout_us: int = 5_000, release_us: int = 10_000) -> None:
        if press_lockout_us < 0 or release_us < 0:
            raise SettingError(f"debounce times are 0 or more, not {press_lockout_us} us and {release_us} us")
        self.press_lockout_us, self.release_us = press_lockout_us, release_us
        self._pause_us = 2 * max(press_lockout_us, release_us)
        self._closed: Mask = 0
        # Read in the last update; and the others, with the time of their last reading.
        self._known: Mask = 0
        self._unread: list[tuple[int, Mask]] = []
        self._time: int | None = None
        self._period: int | None = None
        # Ignored until a time; read open since a time. The two are disjoint, and each switch is in at most one group.
        self._locks: list[tuple[int, Mask]] = []
        self._openings: list[tuple[int, Mask]] = []

    def update(self, time_us: int, closed: Mask, known: Mask) -> Mask:
        """Return the closed switches after a reading of those in `known` at `time_us`, with `closed` among them closed.

        Switches that were not read keep their state, and their timers run on. A time that goes back is ignored.
        """
        now = self._advance(time_us, known)
        free = known & ~self._locked(now) if self._locks else known
        pressed = closed & free & ~self._closed
        opened = ~closed & free & self._closed
        if opened or self._openings:
            self._closed &= ~self._released(now, opened, closed & free)
        if pressed:
            self._closed |= pressed
            self._lock(now, now + self.press_lockout_us, pressed)
        return self._closed

    def _forget_after_pauses(self, last_us: int, interval: int, known: Mask) -> None:
        """Take which switches are read, `interval` after the last reading; begin anew with those that had a pause."""
        since, now = [(last_us, self._known), *self._unread], last_us + interval
        over = sum(mask & known for time, mask in since if now - time > self._pause_us)
        self._unread = [(time, rest) for time, mask in since if (rest := mask & ~known)]
        self._known = known
        self._closed &= ~over
        self._locks, self._openings = (
            [(time, mask & ~over) for time, mask in timers if mask & ~over] for timers in (self._locks, self._openings)
        )

    def _advance(self, time_us: int, known: Mask) -> int:
        """Store the time, and the shortest recent period as the earliest time of the next reading; forget the switches
        that are read after a pause.
        """
        if self._time is None:
            self._time = time_us
        interval = max(0, time_us - self._time)
        if interval > self._pause_us or known != self._known:
            self._forget_after_pauses(self._time, interval, known)
        self._time += interval
        if self._period is None or interval <= self._period:
            self._period = interval or self._period
        else:
            self._period = min(interval, self._period + (self._period >> 2) + 1)
        return self._time

    def _locked(self, now: int) -> Mask:
        self._locks = [lock for lock in self._locks if lock[0] > now]
        locked = 0
        for _, mask in self._locks:
            locked |= mask
        return locked

    def _lock(self, now: int, until: int, mask: Mask) -> None:
        if until > now:
            self._locks.append((until, mask))

    def _released(self, now: int, opened: Mask, closed: Mask) -> Mask:
        """Return the open switches whose release time is over; their bounce is locked out."""
        released, begun, openings = 0, opened, []
        for since, group in self._openings:
            begun &= ~group
            going = self._go(now, since, group & opened)
            released |= going
            if rest := group & ~closed & ~going:
                openings.append((since, rest))
        if begun:
            going = self._go(now, now, begun)
            released |= going
            if rest := begun & ~going:
                openings.append((now, rest))
        self._openings = openings
        return released

    def _go(self, now: int, since: int, group: Mask) -> Mask:
        """Return `group` if the next reading would come too late for its release, else 0."""
        if not group or now + (self._period or 0) < since + self.release_us:
            return 0
        self._lock(now, since + self.release_us, group)
        return group
