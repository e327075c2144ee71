"""The scan map of a build and a harness, against brute force where there are few enough ways."""

from collections.abc import Callable, Sequence
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, MuxChannel, ScannerWiring
from thenar.runtime.scanning import plan
from thenar.runtime.scanning.decided import EarlyExit
from thenar.runtime.scanning.plan import check_harness, plan_scan
from thenar.runtime.scanning.propose import propose_board
from thenar.runtime.scanning.scanmap import Port, ScanMap, check_switches, scanmap_from_bytes, scanmap_to_bytes
from thenar.runtime.scanning.timing import port_us, reading_of, scan_us
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables

Harnesses = Callable[..., st.SearchStrategy[Harness]]
EightChips = Callable[..., Harness]
MakeTables = Callable[..., IntegerTables]


def names_of(count: int) -> list[str]:
    return [f"s{number}" for number in range(count)]


def frames(seed: int, rows: int, tables: IntegerTables) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    bits = random.random((rows, tables.n_switches)) < 0.4
    return bits, random.integers(0, 256, (rows, tables.n_joints)).astype(np.uint16)


def mux_writes(ports: Sequence[Port], harness: Harness) -> int:
    """What a driver writes to muxes in the second of two scans: it remembers what it selected, bus by bus."""
    writes = 0
    selected: dict[int, MuxChannel] = {}
    for scan in range(2):
        writes = 0
        for port in ports:
            mux = harness.buses[port.bus].chips[port.chip].mux
            if mux is None or selected.get(port.bus) == mux:
                continue
            before = selected.get(port.bus)
            writes += 1 + (before is not None and before.address != mux.address) if scan else 0
            selected[port.bus] = mux
    return writes


@settings(deadline=None)
@given(data=st.data())
def test_every_kept_switch_is_read_once_with_the_fewest_writes_to_muxes(
    harnesses: Harnesses, make_tables: MakeTables, data: st.DataObject
) -> None:
    harness = data.draw(harnesses())
    kept = data.draw(st.lists(st.sampled_from(harness.switches), unique=True)) if harness.switches else []
    tables = make_tables(switches=len(kept), joints=1)
    recorded = frames(0, 20, tables) if data.draw(st.booleans()) else (None, None)
    scan = plan_scan(kept, tables, harness, *recorded)
    check_switches(scan, len(kept))
    for port in scan.ports:
        chip = harness.buses[port.bus].chips[port.chip]
        for bit, number in port.switches:
            assert chip.numbered_pins[reading_of(port, harness).pins[bit]] == kept[number]
    for board, pairs in zip(harness.scanners, scan.scanners, strict=True):
        assert all(board.switches[key] == kept[number] for key, number in pairs)
    if len(scan.ports) <= 6:
        least = min(mux_writes(some, harness) for some in permutations(scan.ports))
        assert scan_us(scan, harness).selects == mux_writes(scan.ports, harness) == least
    assert scanmap_from_bytes(scanmap_to_bytes(scan)) == scan


def expected_us(
    ports: Sequence[Port], harness: Harness, tables: IntegerTables, recorded: Sequence[np.ndarray]
) -> float:
    """The mean time until the runtime's own early exit stops a scan of `ports`, nothing behind a mux."""
    bits, codes = recorded
    groups = [sum(1 << number for _, number in port.switches) for port in ports]
    early = EarlyExit(Scorer(tables), groups)
    on_ports, total = sum(groups), 0.0
    for row in range(len(bits)):
        closed = sum(1 << number for number in np.flatnonzero(bits[row]).tolist())
        early.start(codes[row].tolist(), closed & ~on_ports, lost=0)
        for place, port in enumerate(ports):
            total += port_us(reading_of(port, harness), harness.buses[port.bus].clock_hz)
            if early.after(place, closed):
                break
    return total / len(bits)


def uneven_tables(seed: int, switches: int) -> IntegerTables:
    """Tables in which some switches matter much and most little, as boosted ones do."""
    random = np.random.default_rng(seed)
    weight = np.exp(random.normal(0.0, 1.5, (switches, 1)))
    rows = (random.normal(0.0, 60.0, (switches, 4)) * weight).astype(np.int16)
    step = (np.array([100], np.uint16),)
    joint = random.integers(-200, 201, (2, 4)).astype(np.int16)
    none = np.zeros((1, 4), np.int16)
    return IntegerTables(np.zeros(4, np.int16), rows, step, (joint,), (rows * 0.4).astype(np.int16), none, 1.0)


@pytest.mark.parametrize("seed", range(6))
def test_no_other_order_decides_earlier_on_the_recorded_frames(seed: int) -> None:
    random = np.random.default_rng(seed)
    left = iter(names_of(13))
    kinds = [("mcp23017", ["GPA0", "GPA1"]), ("mcp23017", ["GPA0", "GPB1"]), ("pcf8575", ["P00", "P10", "P01"])]
    chips = [
        ChipWiring(kind=kind, address=0x20 + number, pins={pin: next(left) for pin in pins})
        for number, (kind, pins) in enumerate([*kinds, *kinds[:1], ("mcp23008", ["GP0", "GP1"])])
    ]
    board = ScannerWiring(port="p", switches=tuple(left))
    buses = (
        BusWiring(device="a", clock_hz=400_000, chips=tuple(chips[:3])),
        BusWiring(device="b", chips=tuple(chips[3:])),
    )
    harness = Harness(name="x", scanners=(board,), buses=buses)
    names = random.permutation(names_of(13)).tolist()
    tables = uneven_tables(seed, 13)
    recorded = frames(seed, 60, tables)
    scan = plan_scan(names, tables, harness, *recorded)
    times = {some: expected_us(some, harness, tables, recorded) for some in permutations(scan.ports)}
    assert len(times) == 120
    assert times[scan.ports] == pytest.approx(min(times.values()), rel=1e-12)
    # And it matters: the recordings tell orders apart.
    assert max(times.values()) > 1.1 * min(times.values())


def test_without_recordings_what_can_change_scores_most_per_microsecond_comes_first() -> None:
    rows = np.array([[10, 0], [0, 30], [20, 0], [1, 0]], np.int16)
    none, means = np.zeros((0, 2), np.int16), np.zeros((4, 2), np.int16)
    tables = IntegerTables(np.zeros(2, np.int16), rows, (), (), means, none, 1.0)

    def chip(address: int, switch: str, channel: int | None = None) -> ChipWiring:
        mux = None if channel is None else MuxChannel(address=0x70, channel=channel)
        return ChipWiring(kind="mcp23017", address=address, mux=mux, pins={"GPA0": switch})

    flat = Harness(name="x", buses=(BusWiring(device="d", chips=tuple(chip(0x20 + n, f"s{n}") for n in range(4))),))
    assert [port.chip for port in plan_scan(names_of(4), tables, flat).ports] == [1, 2, 0, 3]
    # Behind channels, s1 shares its selection with s3: the two are as far-reaching as s0 and s2 together, 1 apart.
    chips = (chip(0x20, "s0", 0), chip(0x20, "s1", 1), chip(0x21, "s2", 0), chip(0x21, "s3", 1))
    behind = Harness(name="x", buses=(BusWiring(device="d", chips=chips),))
    assert [port.chip for port in plan_scan(names_of(4), tables, behind).ports] == [1, 3, 2, 0]
    # No frames are no recordings.
    empty = np.zeros((0, 4), bool), np.zeros((0, 0), np.uint16)
    assert plan_scan(names_of(4), tables, flat, *empty) == plan_scan(names_of(4), tables, flat)


def test_more_frames_than_are_looked_at_are_thinned_evenly(
    make_tables: MakeTables, eight_chips: EightChips, monkeypatch: pytest.MonkeyPatch
) -> None:
    harness, tables = eight_chips(3), uneven_tables(1, 42)
    bits, codes = frames(0, 101, tables)
    monkeypatch.setattr(plan, "FRAMES", 11)
    assert plan_scan(names_of(42), tables, harness, bits, codes) == plan_scan(
        names_of(42), tables, harness, bits[::10], codes[::10]
    )


def test_recordings_without_joints_need_no_codes(eight_chips: EightChips) -> None:
    tables = uneven_tables(1, 42)
    bare = IntegerTables(tables.bias, tables.switch_rows, (), (), tables.switch_means, np.zeros((0, 4), np.int16), 1.0)
    bits, codes = frames(0, 30, bare)
    harness = eight_chips(3)
    assert plan_scan(names_of(42), bare, harness, bits) == plan_scan(names_of(42), bare, harness, bits, codes)


def test_switches_that_are_wired_to_nothing_are_named(make_tables: MakeTables, eight_chips: EightChips) -> None:
    names = [*names_of(14), *(f"t{number}" for number in range(7))]
    with pytest.raises(
        HarnessError, match=r"'full' has no pin or key for t0, t1, t2, t3, t4 and 2 more, which the build"
    ):
        plan_scan(names, make_tables(switches=21), eight_chips(1))


def test_a_map_goes_with_the_wiring_that_it_was_made_for(make_tables: MakeTables, eight_chips: EightChips) -> None:
    harness = eight_chips(2)
    scan = plan_scan(names_of(28), make_tables(switches=28), harness)
    check_harness(scan, replace(harness, name="renamed"), names_of(28))
    with pytest.raises(HarnessError, match="made for another wiring than harness 'full'"):
        check_harness(scan, eight_chips(3), names_of(28))


@pytest.mark.parametrize(
    "change",
    [
        {"bus": 1},
        {"chip": 9},
        {"reading": "nonsense"},
        {"reading": "GPIOB"},
        {"closed_high": True},
        {"switches": ((65535, 0),)},
        {"switches": ((0, 1), (1, 0))},
    ],
)
def test_a_port_that_the_wiring_does_not_have_is_refused_whoever_sealed_the_map(
    make_tables: MakeTables, eight_chips: EightChips, change: dict[str, object]
) -> None:
    harness = eight_chips(2)
    scan = plan_scan(names_of(28), make_tables(switches=28), harness)
    for number in range(len(scan.ports)):
        ports = [replace(port, **change) if place == number else port for place, port in enumerate(scan.ports)]
        with pytest.raises(HarnessError, match="reads other pins or keys than harness 'full'"):
            check_harness(replace(scan, ports=tuple(ports)), harness, names_of(28))


def test_a_key_that_the_board_does_not_have_is_refused_whoever_sealed_the_map(make_tables: MakeTables) -> None:
    board = propose_board(names_of(3))
    scan = plan_scan(names_of(3), make_tables(switches=3), board)
    check_harness(scan, board, names_of(3))
    for scanners in ((), (((0, 0), (1, 1), (7, 2)),), (((0, 1), (1, 0), (2, 2)),), (*scan.scanners, ())):
        with pytest.raises(HarnessError, match="reads other pins or keys than harness"):
            check_harness(replace(scan, scanners=scanners), board, names_of(3))


def test_a_build_without_switches_reads_nothing(make_tables: MakeTables, eight_chips: EightChips) -> None:
    scan: ScanMap = plan_scan([], make_tables(switches=0), eight_chips(1))
    assert (scan.ports, scan.scanners) == ((), ())


def test_many_ports_behind_muxes_are_planned_in_time(eight_chips: EightChips) -> None:
    (bus,) = eight_chips(24).buses
    chips = tuple(
        replace(chip, address=0x20 + number % 8, mux=MuxChannel(address=0x70 + number // 16, channel=number // 8))
        for number, chip in enumerate(bus.chips)
    )
    harness = Harness(name="x", buses=(replace(bus, chips=chips),))
    tables = uneven_tables(3, 24)
    names = [f"s{14 * number}" for number in range(24)]
    scan = plan_scan(names, tables, harness, *frames(1, 500, tables))
    assert len(scan.ports) == 24
    assert scan_us(scan, harness).selects == 5  # three channels, and two muxes to take turns
