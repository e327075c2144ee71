"""Hard cases: numerical dangers, a reference for each, and the measured error."""

from thenar.drivers.extras import optional

with optional():
    import mpmath  # noqa: F401
