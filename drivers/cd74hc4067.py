"""TI CD74HC4067: an analog multiplexer of sixteen channels, four select lines and a common, for boards' converters."""

from .i2c.chips.base import ChipPackage

CHANNELS = 16
SELECTS = ("S0", "S1", "S2", "S3")
COMMON, ENABLE = "COMMON", "E"

PACKAGE = ChipPackage(
    part="CD74HC4067M96",
    maker="Texas Instruments",
    symbol="CD74HC4067M",
    footprint="Package_SO:SOIC-24W_7.5x15.4mm_P1.27mm",
    pins=(
        COMMON,
        *(f"I{channel}" for channel in reversed(range(8))),
        *("S0", "S1", "GND", "S3", "S2", ENABLE),
        *(f"I{channel}" for channel in reversed(range(8, 16))),
        "VCC",
    ),
    sure=False,
    note="compare symbol and footprint before ordering; up to 70 ohm at 4.5 V, more at 3.3 V, in series with the pad",
    library="Analog_Switch",
)
