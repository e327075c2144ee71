"""`java.util.Random`, as its documentation fixes it: what Weka shuffles with."""

_MULTIPLIER = 0x5DEECE66D
_INCREMENT = 0xB
_MASK = (1 << 48) - 1


class JavaRandom:
    """The 48-bit linear congruential generator of java.util.Random, seeded as `new Random(seed)`."""

    def __init__(self, seed: int) -> None:
        self._state = (seed ^ _MULTIPLIER) & _MASK

    def next_bits(self, bits: int) -> int:
        """Return the next `bits` (1 to 32) random bits, as a number that is not negative."""
        self._state = (self._state * _MULTIPLIER + _INCREMENT) & _MASK
        return self._state >> (48 - bits)

    def next_int(self, bound: int) -> int:
        """Return a uniform integer in [0, bound), as nextInt(bound); ValueError unless 0 < bound < 2^31."""
        if not 0 < bound < 1 << 31:
            raise ValueError(f"bound {bound} is not in 1..2147483647")
        if bound & (bound - 1) == 0:
            return bound * self.next_bits(31) >> 31
        while True:
            drawn = self.next_bits(31)
            remainder = drawn % bound
            # The last, incomplete run of `bound` numbers below 2^31 would favour small remainders: draw again.
            if drawn - remainder + bound <= 1 << 31:
                return remainder

    def shuffle(self, items: list[int]) -> None:
        """Shuffle `items` in place: for i from the end down to 1, swap items i and nextInt(i + 1)."""
        for i in range(len(items) - 1, 0, -1):
            j = self.next_int(i + 1)
            items[i], items[j] = items[j], items[i]
