from collections.abc import Callable

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thenar.drivers.i2c.chips import CHIPS, expanders
from thenar.drivers.ports import port_fault
from thenar.runtime.harness.checks import faults
from thenar.runtime.harness.wiring import (
    BoardWiring,
    BusWiring,
    ChipWiring,
    Debounce,
    GloveWiring,
    Harness,
    MuxChannel,
    StreamWiring,
)
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.names import fault
from thenar.runtime.taxels import TaxelSettings

Load = Callable[[str], Harness]

names = st.text(max_size=6).filter(lambda name: not fault(name))
ports = names.filter(lambda name: not port_fault(name))


def board_of(switches: tuple[str, ...]) -> BoardWiring:
    chip = ChipWiring(kind="mcp23017", address=0x23, pins={"GPA0": switches[0]})
    return BoardWiring(pins={name: f"A{number}" for number, name in enumerate(switches[1:])}, chips=(chip,))


gloves = st.builds(
    GloveWiring,
    port=ports,
    baud=st.integers(1, 10**6),
    rate_hz=st.none() | st.floats(0.1, 900.0),
    sensors=st.sampled_from([None, 18, 22]),
    calibration=st.none() | st.just("/a/b.toml"),
)


@st.composite
def harnesses(draw: st.DrawFn) -> Harness:
    """Sound harnesses: chips of any kind, each behind a channel of its own if behind any."""
    left = iter(draw(st.lists(names, min_size=30, max_size=30, unique=True)))
    chips, switched = [], expanders().values()
    for address in draw(st.lists(st.integers(0, 7), max_size=3, unique=True)):
        kind = CHIPS[draw(st.sampled_from(sorted(CHIPS)))]
        usable = [pin for pin in kind.pins if pin not in kind.not_inputs]
        pins = draw(st.lists(st.sampled_from(usable), max_size=5, unique=True))
        few = len(kind.addresses) < 8  # two of them may have one address
        mux = MuxChannel(address=0x73, channel=address) if few or draw(st.booleans()) else None
        chips.append(
            ChipWiring(
                kind=kind.name,
                address=kind.addresses[address % len(kind.addresses)],
                mux=mux,
                pins={pin: next(left) for pin in pins},
                closed=draw(st.sampled_from(["low", "high"] if kind.registers and kind in switched else ["low"])),
            )
        )
    switches = tuple(next(left) for _ in range(draw(st.integers(1, 4))))
    stream = StreamWiring(port="p", switches=switches, board=board_of(switches) if draw(st.booleans()) else None)
    return Harness(
        name=draw(names),
        cyberglove=draw(st.none() | gloves),
        streams=(stream,),
        buses=(BusWiring(device="/dev/i2c-1", chips=tuple(chips)),),
        debounce=Debounce(enabled=draw(st.booleans()), release_ms=draw(st.floats(0.0, 1000.0))),
        taxel_settings=TaxelSettings(calibration=draw(st.none() | st.just("/a/c.toml"))),
    )


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(harness=harnesses())
def test_what_is_written_is_read_again(load: Load, harness: Harness) -> None:
    clashes = list(faults(harness))
    assert all("change one" in reason for _, reason in clashes)
    if not clashes:
        assert load(harness_to_toml(harness)) == harness


def test_addresses_are_written_as_they_are_spoken_of(load: Load, full_text: str) -> None:
    text = harness_to_toml(load(full_text))
    assert "address = 0x20\n" in text
    assert "address = 0x70\nchannel = 2\n" in text
    assert '    { kind = "mcp23017", address = 0x21, pins = ' in text
