"""Switches that are read again after a pause, of which nothing that was read before it says anything."""

from .frames import Mask


class Pauses:
    """Notes which switches are read, and for how long the others have not been."""

    def __init__(self, pause_us: int) -> None:
        self.pause_us = pause_us
        self._known: Mask = 0
        self._away: list[tuple[int, Mask]] = []

    def over(self, time_us: int, known: Mask) -> Mask:
        """Return which of the switches that are read now were not read for longer than `pause_us`."""
        over, away = 0, []
        for since_us, switches in self._away:
            if time_us - since_us > self.pause_us:
                over |= switches & known
            if rest := switches & ~known:
                away.append((since_us, rest))
        if gone := self._known & ~known:
            away.append((time_us, gone))
        self._known, self._away = known, away
        return over
