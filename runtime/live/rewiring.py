"""The bits of a device turned into the switches that are asked for."""

from collections.abc import Iterable

from .frames import Mask


class Rewired:
    """Turns a set of a device's bits into a set of switches: bit by bit where `pairs` (bit, switch) say so.

    Calling it costs a look-up as long as nothing changes: a hand rests for many scans.
    """

    __slots__ = ("_last", "_pairs", "_turned", "targets")

    def __init__(self, pairs: Iterable[tuple[int, int]]) -> None:
        self._pairs = tuple((1 << bit, 1 << switch) for bit, switch in pairs)
        self.targets: Mask = sum(switch for _, switch in self._pairs)
        self._last, self._turned = 0, 0

    def __call__(self, bits: Mask) -> Mask:
        """Return the switches of the device's `bits`."""
        if bits != self._last:
            self._turned = sum(switch for bit, switch in self._pairs if bits & bit)
            self._last = bits
        return self._turned
