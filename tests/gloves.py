"""Harnesses that several tests wire, and lines of taxels."""

from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, MuxChannel
from thenar.runtime.taxels import TaxelLine


def behind(*places: tuple[int, int] | None) -> Harness:
    """Return a PCA9555 with one switch for each place: straight on the bus, or behind a channel of a mux."""
    chips = tuple(
        ChipWiring(
            kind="pca9555",
            address=0x20 + number,
            mux=None if place is None else MuxChannel(address=place[0], channel=place[1]),
            pins={"P00": f"s{number}"},
        )
        for number, place in enumerate(places)
    )
    return Harness(name="x", buses=(BusWiring(device="d", clock_hz=400_000, chips=chips),))


def pad_line(name: str, rest: int, press: int, value: float = 1.0) -> TaxelLine:
    """Return the line of a taxel whose press is worth `value`."""
    return TaxelLine(name, rest, 0.0, press, value)
