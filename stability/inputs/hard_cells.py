"""Numbers that are hard to part, to code, or to read: what the case about codes imports."""

import math

# Neighbouring doubles, subnormal ones, both zeros, and ends at which a sum of two overflows.
HARD_DOUBLES = sorted(
    {
        *(sign * x for sign in (-1, 1) for x in (5e-324, 1e-323, 2.2e-308, 1e-9, 1.0, 1e12, 8.9e307, 1.7e308)),
        *(math.nextafter(x, math.inf) for x in (5e-324, 1.0, 1e12, 1.7e308, -1.7e308)),
        *(1.0 + n * 1e-9 for n in range(1, 4)),
        0.0,
    }
)

# Values, and the grid that they are coded on: half a step from two codes, a billionth apart, far from zero, next to the
# closest grid there may be, subnormal, zeros, without an end in binary, huge and tiny.
HARD_DEGREES: tuple[tuple[tuple[float, ...], float], ...] = (
    ((0.24999, 0.25, 0.75, 1.25, 32767.5), 0.5),
    ((1.0, 1.000000001, 1.000000002), 0.5),
    ((1e-9, 2e-9, 3e-9, 65535e-9), 1e-9),
    ((1e12, 1e12 + 2000, 1e12 + 3000, 1e12 + 130e6), 2000.0),
    ((123456789.123, 123456789.223, 123456790.777), 0.2),
    ((-0.0, 0.0, 5e-324, -5e-324, 2.2e-308), 0.5),
    ((-0.0, -1e-9, 1e-9), 0.1),
    ((-180.0, 179.999999999, 180.0, 0.1, -0.1), 1 / 3),
    ((1e200, 3.3e200, 9e203), 1e200),
    ((1e-200, 1.4e-200, 2.3e-199), 1e-200),
)

# The cells of a joint, a switch, a trial and a label that are no such thing; the empty ones are missing.
NO_NUMBERS = ("inf", "-inf", "Infinity", "1e400", "-1e400", "nan", "NaN", "", "?", "1_0", "0x10", "1,5", "one")
NO_CODES = (*NO_NUMBERS, "-1", "65536", "0.5", "1e12", "5e-324")
NO_BITS = (*NO_NUMBERS, "2", "-1", "0.5", "5e-324")
NO_TRIALS = (*NO_NUMBERS, "0.5", "1e300", "9007199254740994")
NO_FLOATS = (math.inf, -math.inf, math.nan)
