"""TI TCA9548A: a mux of eight channels behind one control register. Bit c of the register connects channel c."""

ADDRESSES = range(0x70, 0x78)
CHANNELS = range(8)
CLOCK_HZ = 400_000

# Address and control byte: what one selection costs, and what reading the register back costs.
WIRE_BYTES = 2
SCL_PERIODS = 20


def control(channel: int | None) -> bytes:
    """Return the control byte that connects this channel alone, or none; it takes effect at the STOP."""
    return bytes((0 if channel is None else 1 << channel,))
