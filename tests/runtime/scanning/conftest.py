"""Harnesses of any small shape."""

from hypothesis import strategies as st

from thenar.drivers.i2c.chips import CHIPS
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, MuxChannel, StreamWiring

_KINDS = ("mcp23017", "pcf8575", "tca6424a", "mcp23008")
# Where a chip may be: straight on bus 0 or 1, or behind one of two muxes of bus 0. Its address goes by its number.
_PLACES = ((0, None), (1, None), (0, (0x70, 0)), (0, (0x70, 1)), (0, (0x71, 5)))


@st.composite
def harnesses(draw: st.DrawFn, chips: int = 3, pins: int = 6) -> Harness:
    """A sound harness of up to so many chips with up to so many switches each, and perhaps a board; s0, s1, ..."""
    buses: tuple[list[ChipWiring], list[ChipWiring]] = ([], [])
    switch = 0
    for number in range(draw(st.integers(0, chips))):
        kinds = [kind for kind in _KINDS if 0x20 + number in CHIPS[kind].addresses]
        kind = CHIPS[draw(st.sampled_from(kinds))]
        bus, behind = draw(st.sampled_from(_PLACES))
        usable = [pin for pin in kind.pins if pin not in kind.not_inputs]
        used = draw(st.lists(st.sampled_from(usable), max_size=pins, unique=True))
        buses[bus].append(
            ChipWiring(
                kind=kind.name,
                address=0x20 + number,
                mux=None if behind is None else MuxChannel(address=behind[0], channel=behind[1]),
                pins={pin: f"s{switch + index}" for index, pin in enumerate(used)},
                closed=draw(st.sampled_from(["low", "high"] if kind.registers else ["low"])),
            )
        )
        switch += len(used)
    keys = [f"s{switch + index}" for index in range(draw(st.integers(0, 3)))]
    return Harness(
        name="any",
        streams=(StreamWiring(port="p", switches=("unused", *keys)),) if keys else (),
        buses=tuple(
            BusWiring(device=f"/dev/i2c-{bus}", clock_hz=draw(st.sampled_from([100_000, 400_000])), chips=tuple(wired))
            for bus, wired in enumerate(buses)
        ),
    )


def eight_chips(chips: int = 8) -> Harness:
    """Return a harness of MCP23017s at 400 kHz with all usable pins wired, 14 switches each."""
    usable = [f"GP{port}{bit}" for port in "AB" for bit in range(7)]
    wired = tuple(
        ChipWiring(
            kind="mcp23017",
            address=0x20 + chip,
            pins={pin: f"s{14 * chip + index}" for index, pin in enumerate(usable)},
        )
        for chip in range(chips)
    )
    return Harness(name="full", buses=(BusWiring(device="/dev/i2c-1", clock_hz=400_000, chips=wired),))
