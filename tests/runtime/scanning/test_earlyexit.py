"""The leader cannot be overtaken: exhaustively on small tables, and on every recorded frame of a real data set."""

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler import compile_build
from thenar.compiler.artifact.verify_firmware import select_inputs
from thenar.compiler.recordings.importer import import_file
from thenar.drivers.errors import SettingError
from thenar.runtime import Build
from thenar.runtime.scanning.decided import EarlyExit
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables

COLUMNS = Path(__file__).resolve().parents[3] / "examples" / "columns"
OPEN, CLOSED, LOST = range(3)

MakeTables = Callable[..., IntegerTables]
State = tuple[int, ...]
Frames = tuple[Build, np.ndarray, np.ndarray]


def small_tables(seed: int, switches: int = 5, largest: int = 3) -> IntegerTables:
    """Few classes and small steps, so that ties are common; means that need not lie between open and closed."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-largest, largest + 1, shape).astype(np.int16)

    step = (np.array([100], np.uint16),)
    return IntegerTables(
        rows(3) * np.int16(2), rows(switches, 3), step, (rows(2, 3),), rows(switches, 3), rows(1, 3), 1.0
    )


def mask(state: State, what: int) -> int:
    return sum(1 << switch for switch, value in enumerate(state) if value == what)


def all_lanes(tables: IntegerTables, codes: list[int]) -> dict[State, tuple[int, ...]]:
    """The scores of every state that switches can be in."""
    scorer = Scorer(tables)
    return {
        state: scorer.lanes_without(np.array(state) == CLOSED, codes, np.array(state) == LOST, [False])
        for state in product((OPEN, CLOSED, LOST), repeat=tables.n_switches)
    }


def winner(lanes: tuple[int, ...]) -> int:
    return lanes.index(max(lanes))


def lead_of(number: int, lanes: tuple[int, ...]) -> int:
    return lanes[number] - max(lane for other, lane in enumerate(lanes) if other != number)


def ends(exit_: EarlyExit, codes: list[int] | None, state: State, ports: int) -> list[bool]:
    exit_.start(codes)
    return [exit_.after(port, mask(state, CLOSED), mask(state, LOST)) for port in range(ports)]


@pytest.mark.parametrize("groups", [((0,), (1,), (2,), (3,), (4,)), ((0, 1), (2, 3), (4,)), ((4, 2), (1, 3, 0))])
@pytest.mark.parametrize("seed", range(4))
def test_a_scan_stops_exactly_when_every_completion_has_the_same_winner(
    seed: int, groups: tuple[tuple[int, ...], ...]
) -> None:
    """Every state of every switch, open, closed or lost, and so every pattern of bits and of lost ports."""
    tables, stopped = small_tables(seed), 0
    exit_ = EarlyExit(Scorer(tables), [sum(1 << switch for switch in group) for group in groups])
    for codes in ([0], [200]):
        winners = {state: winner(lanes) for state, lanes in all_lanes(tables, codes).items()}
        for state in winners:
            found = ends(exit_, codes, state, len(groups))
            for port, end in enumerate(found):
                read = [switch for group in groups[: port + 1] for switch in group]
                alike = {w for other, w in winners.items() if all(other[s] == state[s] for s in read)}
                assert end == (len(alike) == 1)
            stopped += found.index(True) < len(groups) - 1
    assert stopped > 0 or len(groups) < 3  # of two large ports, the second is always needed in some of these


@pytest.mark.parametrize("lead", [1, 2, 5])
def test_with_a_lead_a_scan_stops_exactly_when_every_completion_has_that_lead(lead: int) -> None:
    tables, codes, groups = small_tables(1, switches=4), [0], (0b0011, 0b1100)
    exit_, lanes = EarlyExit(Scorer(tables), groups, lead=lead), all_lanes(tables, [0])
    seen = set()
    for state in lanes:
        alike = [lanes[other] for other in lanes if other[:2] == state[:2]]
        leading = winner(alike[0])
        sure = all(winner(other) == leading and lead_of(leading, other) >= lead for other in alike)
        found = ends(exit_, codes, state, 2)
        assert found == [sure, lead_of(winner(lanes[state]), lanes[state]) >= lead]
        seen |= set(found)
    assert seen == {True, False}


@pytest.mark.parametrize(("bias", "expected"), [((5, 3), True), ((3, 5), False), ((4, 3), False), ((3, 6), True)])
def test_a_tie_is_an_overtaking_only_for_the_lower_number(bias: tuple[int, int], expected: bool) -> None:
    """The unread switch brings the second two steps closer, whichever that is."""
    none, gain = np.zeros((0, 2), np.int16), [0, 2] if bias[0] > bias[1] else [2, 0]
    rows = np.array([[0, 0], gain], np.int16)
    tables = IntegerTables(np.array(bias, np.int16), rows, (), (), 0 * rows, none, 1.0)
    exit_ = EarlyExit(Scorer(tables), [1, 2])
    exit_.start([])
    assert exit_.after(0, 0) is expected


@given(data=st.data(), seed=st.integers(0, 30))
def test_a_scan_starts_afresh_whatever_went_before(make_tables: MakeTables, data: st.DataObject, seed: int) -> None:
    tables, groups = make_tables(seed), [0b111, 0b111000, 0b111000000]
    masks, codes = st.integers(0, 511), st.none() | st.lists(st.integers(0, 255), min_size=3, max_size=3)
    used, scans = (
        EarlyExit(Scorer(tables), groups),
        data.draw(st.lists(st.tuples(masks, masks, codes), min_size=1, max_size=5)),
    )
    for closed, lost, joints in scans:
        fresh = EarlyExit(Scorer(tables), groups)
        for exit_ in (used, fresh):
            exit_.start(joints)
        for port in range(3):
            assert used.after(port, closed, lost) == fresh.after(port, closed, lost)


@given(closed=st.integers(0, 511), lost=st.integers(0, 511), seed=st.integers(0, 30))
def test_switches_of_no_port_are_known_from_the_start_or_lost(
    make_tables: MakeTables, closed: int, lost: int, seed: int
) -> None:
    tables, board, codes = make_tables(seed), 0b111, [1, 2, 3]
    known, whole = (
        EarlyExit(Scorer(tables), [0b111000, 0b111000000]),
        EarlyExit(Scorer(tables), [board, 0b111000, 0b111000000]),
    )
    for elsewhere in (lost, None):
        known.start(codes, closed, elsewhere)
        whole.start(codes)
        whole.after(0, closed, board if elsewhere is None else elsewhere)
        ends = [whole.after(port, closed, lost) for port in (1, 2)]
        assert [known.after(port, closed, lost) for port in (0, 1)] == ends


def test_what_is_left_after_a_port_is_told(make_tables: MakeTables) -> None:
    exit_ = EarlyExit(Scorer(make_tables()), [0b1, 0b110, 0b1000])
    assert [exit_.unread(port) for port in range(3)] == [0b1110, 0b1000, 0]


@pytest.mark.parametrize("groups", [[1, 3], [1 << 9], [1, 0, 1]])
def test_ports_that_do_not_fit_the_build_are_refused(make_tables: MakeTables, groups: list[int]) -> None:
    with pytest.raises(SettingError, match="read by two ports, or is not in the build"):
        EarlyExit(Scorer(make_tables()), groups)


@pytest.fixture(scope="module")
def recorded(icub_table: Path, tmp_path_factory: pytest.TempPathFactory) -> Frames:
    """A build of real recordings, and every one of their frames."""
    grasp_set, _ = import_file(icub_table, COLUMNS / "icub.toml")
    folder = tmp_path_factory.mktemp("icub") / "build"
    manifest = compile_build(grasp_set, folder, rounds=100, folds=0).manifest
    bits, codes = select_inputs(grasp_set, manifest)
    return Build.load(folder), bits, codes


def packed(bits: np.ndarray) -> int:
    return sum(1 << int(switch) for switch in np.flatnonzero(bits))


@pytest.mark.parametrize(("width", "least"), [(1, 0.8), (8, 0.6), (16, 0.3)])
def test_on_every_recorded_frame_the_early_answer_is_the_full_scans(recorded: Frames, width: int, least: float) -> None:
    """Also when any of the ports that were left out had been lost."""
    build, bits, codes = recorded
    count = build.tables.n_switches
    ports = [range(first, min(first + width, count)) for first in range(0, count, width)]
    exit_ = EarlyExit(Scorer(build.tables), [sum(1 << switch for switch in port) for port in ports])
    present, left_out = np.zeros(build.tables.n_joints, bool), 0
    for frame_bits, frame_codes in zip(bits, codes, strict=True):
        full = build.classify(frame_bits, frame_codes)
        exit_.start(frame_codes.tolist())
        last = next(port for port in range(len(ports)) if exit_.after(port, packed(frame_bits)))
        left_out += len(ports) - 1 - last
        for lost_ports in patterns(range(last + 1, len(ports))):
            lost = np.isin(np.arange(count), [switch for port in lost_ports for switch in ports[port]])
            lanes = build.scorer.lanes_without(frame_bits, frame_codes, lost, present)
            assert build.grasps[winner(lanes)] == full
    share = left_out / (len(bits) * len(ports))
    print(f"early exit, {width} switches a port: {share:.1%} of {len(ports)} ports left out, {len(bits)} frames")
    assert share > least


def patterns(ports: range) -> list[tuple[int, ...]]:
    """Every set of so few ports; of many, none, all, and each alone."""
    if len(ports) <= 4:
        chosen = product((False, True), repeat=len(ports))
        return [tuple(port for port, taken in zip(ports, which, strict=True) if taken) for which in chosen]
    return [(), tuple(ports), *((port,) for port in ports)]


def test_on_every_recorded_frame_no_bits_of_the_ports_left_out_change_the_answer(recorded: Frames) -> None:
    build, bits, codes = recorded
    count, random = build.tables.n_switches, np.random.default_rng(7)
    exit_ = EarlyExit(Scorer(build.tables), [1 << switch for switch in range(count)])
    for frame_bits, frame_codes in zip(bits, codes, strict=True):
        full = build.classify(frame_bits, frame_codes)
        exit_.start(frame_codes.tolist())
        last = next(port for port in range(count) if exit_.after(port, packed(frame_bits)))
        for _ in range(20):
            other = np.where(np.arange(count) > last, random.random(count) < 0.5, frame_bits)
            assert build.classify(other, frame_codes) == full
