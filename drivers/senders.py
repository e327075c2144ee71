"""Several senders in one place: rows of one of them count, those of all others are counted and left out."""

from collections.abc import Hashable

# A stream belongs to its first sender until that one has been silent for this long.
SILENCE_US = 1_000_000
# Another sender is reported until it has been silent for this long.
REPORT_US = 2_000_000


class FirstSender:
    """Admits the first sender that it meets until that one stops sending, then the next that sends.

    current  the sender that is admitted; None before the first
    """

    def __init__(self) -> None:
        self.current: Hashable | None = None
        self._other: Hashable | None = None
        self._heard_us = self._other_us = 0

    def admits(self, sender: Hashable, now_us: int) -> bool:
        """Return whether what `sender` sent at this time of the monotonic clock counts."""
        if self.current is None or now_us - self._heard_us >= SILENCE_US:
            self.current = sender
        if sender == self.current:
            self._heard_us = now_us
            return True
        self._other, self._other_us = sender, now_us
        return False

    def other(self, now_us: int) -> Hashable | None:
        """Return the last sender that was not admitted, if it still sends."""
        return self._other if now_us - self._other_us < REPORT_US else None
