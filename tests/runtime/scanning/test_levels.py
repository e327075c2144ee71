"""Levels of taxels in scan maps: one conversion each, checked with the wiring."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.glove.propose import propose_board, propose_harness
from thenar.compiler.placement.ports import WireTimes
from thenar.compiler.scan_file import scanmap_from_bytes, scanmap_to_bytes
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, SpiWiring, StreamWiring
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us

START, READ, WAIT = 38 / 0.4 + 1.3, 48 / 0.4 + 1.3, 1317.0  # of an ADS1115 at 400 kHz


def ads1115(number: int, *taxels: str) -> ChipWiring:
    pins = {f"AIN{channel}": taxel for channel, taxel in enumerate(taxels)}
    return ChipWiring(kind="ads1115", address=0x48 + number, pins=pins)


def glove(*chips: ChipWiring, spi: tuple[SpiWiring, ...] = (), streams: tuple[StreamWiring, ...] = ()) -> Harness:
    bus = BusWiring(device="/dev/i2c-1", clock_hz=400_000, chips=chips)
    return Harness(name="x", streams=streams, buses=(bus,), spi=spi)


MIXED = glove(
    ChipWiring(kind="mcp23017", address=0x20, pins={"GPA0": "s0", "GPB3": "s>1"}),
    ads1115(0, "t0", "t1", "t2"),
    ChipWiring(kind="ads7828", address=0x4B, pins={"CH6": "t3"}),
    spi=(SpiWiring(device="/dev/spidev0.0", kind="mcp3208", pins={"CH0": "t4", "CH5": "t5"}),),
    streams=(StreamWiring(port="p", switches=("s2",), taxels={"t7": (0, 1023), "t6": (0, 1023)}),),
)
names = st.one_of(
    st.sampled_from(["s0", "s>1", "s2"]),
    st.builds("t{}>{}".format, st.integers(0, 6), st.integers(0, 4095)),
)


@settings(deadline=None)
@given(kept=st.lists(names, unique=True, max_size=25))
def test_a_taxels_levels_share_one_conversion(kept: list[str]) -> None:
    scan = plan_scan(kept, MIXED)
    assert sorted(scan.switches) == [*range(len(kept))]
    assert scanmap_from_bytes(scanmap_to_bytes(scan)) == scan
    taxels = {name.split(">")[0] for name in kept if name[0] == "t"}
    measured = [port for port in scan.ports if port.levels]
    assert len(measured) == len(taxels - {"t6"})
    for port in measured:
        chip = MIXED.wires[port.bus].chips[port.chip]
        taxel = chip.numbered_pins[chip.chip.pins.index(port.reading)]
        assert {kept[number]: code for code, number in port.levels} == {
            name: int(name.split(">")[1]) for name in kept if name.startswith(f"{taxel}>")
        }
    (stream,) = scan.streams
    assert [(kept[number], place) for place, _, number in stream.levels] == sorted(
        ((name, 1) for name in kept if name.startswith("t6>")), key=lambda pair: int(pair[0][3:])
    )


def test_with_every_taxel_those_without_levels_are_converted_too() -> None:
    scan = whole_scan(MIXED, ["s0", "t1>5"], every_taxel=True)
    assert [(port.reading, port.levels) for port in scan.ports if not port.switches] == [
        *(("AIN0", ()), ("AIN1", ((5, 1),)), ("AIN2", ()), ("CH6", ()), ("CH0", ()), ("CH5", ())),
    ]


def test_a_wired_switch_named_like_a_level_is_a_switch() -> None:
    harness = glove(ChipWiring(kind="mcp23017", address=0x20, pins={"GPA0": "t0>7"}), ads1115(0, "t0"))
    scan = whole_scan(harness, ["t0>7", "t0>8"])
    assert [(port.switches, port.levels) for port in scan.ports] == [(((0, 0),), ()), ((), ((8, 1),))]


def test_taxels_that_are_wired_to_nothing_are_named() -> None:
    with pytest.raises(HarnessError, match="'x' has no pin or column for t9>7, t1, which the build keeps"):
        plan_scan(["t0>7", "t9>7", "t1"], glove(ads1115(0, "t0")))


# Times.


def test_converters_and_expanders_are_read_one_after_the_other() -> None:
    harness = glove(
        *(ads1115(number, f"a{number}", f"b{number}") for number in range(4)),
        ChipWiring(kind="mcp23017", address=0x20, pins={"GPA0": "s0"}),
    )
    kept = [*(f"{taxel}{number}>1" for number in range(4) for taxel in "ab"), "s0"]
    scan = whole_scan(harness, kept)
    time, times = scan_us(scan, harness), WireTimes(scan.ports, harness)
    alone = scan_us(whole_scan(harness, ["s0"]), harness)
    assert time.us == pytest.approx(8 * (START + WAIT + READ) + alone.us)
    assert sum(times.after(0, port) for port in range(len(scan.ports))) == pytest.approx(1000 * time.us, abs=10)


# Proposals.


@pytest.mark.parametrize("count", [1, 8, 9, 40, 160])
def test_a_new_glove_has_its_taxels_on_converters(count: int) -> None:
    kept = ["s0", *(f"t{number}>{code}" for number in range(count) for code in (5, 70))]
    harness = propose_harness(kept)
    assert harness.switches == ("s0",)
    assert harness.taxel_names == tuple(f"t{number}" for number in range(count))
    assert sorted(whole_scan(harness, kept).switches) == list(range(2 * count + 1))
    assert parse_harness(harness_to_toml(harness), "glove.toml") == harness
    (stream,) = propose_board(kept).streams
    assert stream.board is not None
    assert sorted(stream.board.wired) == sorted(("s0", *harness.taxel_names))
    assert bool(stream.board.select) == (count > 6)


@pytest.mark.parametrize("kind", ["ads1115", "ads7828", "mcp3208", "mcp3004"])
def test_the_converters_of_a_new_glove_may_be_chosen(kind: str) -> None:
    harness = propose_harness(["s0", *(f"t{number}>9" for number in range(10))], kind)
    chips = [(chip.kind, len(chip.pins)) for bus in harness.buses for chip in bus.chips]
    chips += [(chip.kind, len(chip.pins)) for chip in harness.spi]
    channels = {"ads1115": [4, 4, 2], "mcp3004": [4, 4, 2]}.get(kind, [8, 2])
    assert chips == [("mcp23017", 1), *((kind, count) for count in channels)]
    assert len({chip.device for chip in harness.spi}) == len(harness.spi)
    assert parse_harness(harness_to_toml(harness), "glove.toml") == harness


def test_no_row_has_so_many_columns() -> None:
    with pytest.raises(HarnessError, match="2001 switches and taxels, but a row has at most 2000: use several boards"):
        propose_board([f"t{number}>5" for number in range(2001)])
