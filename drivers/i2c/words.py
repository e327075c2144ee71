"""What an errno of an I2C transfer means, in words that say what to check."""

import errno

# No acknowledge: bcm2835 and designware, i2c-gpio, i2c-stub.
NOBODY_THERE = frozenset({errno.EREMOTEIO, errno.ENXIO, errno.ENODEV})
# A line may be held low.
STUCK = frozenset({errno.ETIMEDOUT, errno.EBUSY, errno.EAGAIN})
# The adapter's driver refuses the batch, not the chip.
REFUSED = frozenset({errno.EOPNOTSUPP, errno.EINVAL})

_MEANINGS = {
    errno.ETIMEDOUT: "the transfer did not end: SCL or SDA is held low, or the chip stretches the clock",
    errno.EAGAIN: "the adapter lost SDA to somebody else: is the line held low, or is there another master?",
    errno.EIO: "the transfer broke off: check cable length, pull-ups and supply",
    errno.EBUSY: "busy: a driver of the kernel has the address (unbind it), or SDA is held low",
    errno.EOPNOTSUPP: "this adapter cannot do such a transfer: use another adapter",
}


def meaning(code: int | None) -> str:
    """Return what an errno says about a transfer."""
    if code in NOBODY_THERE:
        return "does not answer: check its supply, its wires and its address pins"
    words = _MEANINGS.get(code or errno.EIO, "the transfer failed: check cable and adapter")
    return f"does not work: {words}"


def failure(named: str, code: int | None) -> str:
    """Return the whole sentence about a transfer with what is `named`."""
    return f"{named} {meaning(code)} (errno {code})"


def stuck(device: str, code: int | None) -> str:
    """Return what to say of a bus on which nothing goes any more."""
    found = "SDA reads low all the time" if code is None else f"every transfer fails (errno {code})"
    return (
        f"{device} is stuck: {found}. Tries go on once a second; if they do not help, look for a wire to ground, take "
        "the chips' supply away for a moment, or clock SCL nine times by hand (unbind the adapter's driver first)"
    )
