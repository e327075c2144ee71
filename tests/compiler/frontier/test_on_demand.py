"""Records on demand: what a design of them costs, and how long it keeps one waiting, frame by frame."""

import numpy as np
import pytest

from thenar.compiler.frontier.latency import Pace, latency, latency_on_demand
from thenar.compiler.frontier.price import Tabled
from thenar.compiler.frontier.search import Shape
from thenar.compiler.frontier.stream import Stream, composed_stream
from thenar.compiler.frontier.timing.scan_times import scan_times
from thenar.compiler.frontier.timing.wirings import Wiring, names_of
from thenar.compiler.tables.quantise import integer_scores
from thenar.runtime.policy import Policy
from thenar.runtime.scanning.decided import EarlyExit
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables

TABLED = Tabled(1, Shape(16))
QUICK, SLOW = 1000, 4000


def tables_of(seed: int, joint_steps: int) -> IntegerTables:
    """Tables of 8 switches and 2 joints, which add up to so many steps each."""
    random = np.random.default_rng(seed)

    def rows(most: int, *shape: int) -> np.ndarray:
        return random.integers(-most, most + 1, shape).astype(np.int16)

    steps = (np.array([80, 140], np.uint16),) * 2
    joints = (rows(joint_steps, 3, 4), rows(joint_steps, 3, 4))
    return IntegerTables(rows(9, 4), rows(40, 8, 4), steps, joints, rows(20, 8, 4), rows(joint_steps, 2, 4), 8.0)


def frames(seed: int, n: int = 200) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return random.random((n, 8)) < 0.4, random.integers(1, 256, (n, 2)).astype(np.uint16)


def stream_of(tables: IntegerTables, seed: int) -> Stream:
    bits, codes = frames(seed, 60)
    return composed_stream(bits, codes, integer_scores(tables, bits, codes).argmax(axis=1), seed=seed, grasps=40)


@pytest.mark.parametrize("seed", range(3))
def test_scans_and_their_records_are_those_of_the_runtimes_early_exit(seed: int) -> None:
    tables, (bits, codes) = tables_of(seed, 12), frames(seed)
    wiring, names = Wiring("pcf8574", 400_000), names_of(8)
    times = scan_times(names, tables, wiring, bits, codes)
    early = EarlyExit(Scorer(tables), [(1 << 8) - 1], on_demand=True)
    asked = 0
    for row in bits:
        early.start(None)
        asked += not early.after(0, sum(1 << switch for switch in np.flatnonzero(row).tolist()))
    assert 0 < asked < len(bits)
    assert times.asked == asked / len(bits)
    assert (times.alone_us, times.alone_ports) == (times.full_us, 1.0)


def test_joints_that_add_nothing_are_never_asked_for_and_others_the_more_the_more_they_add() -> None:
    bits, codes = frames(1)
    shares = [
        scan_times(names_of(8), tables_of(1, steps), Wiring("pcf8574", 400_000), bits, codes).asked
        for steps in (0, 6, 25, 400)
    ]
    assert shares[0] == 0.0
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def played(tables: IntegerTables, stream: Stream, quick: int, slow: int) -> list[int]:
    """Frame after frame, by the runtime's own early exit: how long each grasp waits, -1 where it is missed."""
    early = EarlyExit(Scorer(tables), [(1 << 8) - 1], on_demand=True)
    at = (stream.at_us - stream.at_us[0]).tolist()
    winners = integer_scores(tables, stream.bits, stream.codes).argmax(axis=1).tolist()
    state, now, said = 0, 0, list[tuple[int, int]]()
    while now < at[-1]:
        while at[state + 1] <= now:
            state += 1
        early.start(None)
        done = early.after(0, sum(1 << switch for switch in np.flatnonzero(stream.bits[state]).tolist()))
        now += quick if done else slow
        said.append((now, winners[state]))
    waits = []
    for arrival, end in zip(stream.arrivals.tolist(), stream.ends.tolist(), strict=True):
        right = stream.types[arrival]
        stands = [answer for told, answer in said if told <= at[arrival]][-1:]
        later = [told for told, answer in said if at[arrival] < told <= at[end] and answer == right]
        waits.append(0 if stands == [right] else later[0] - at[arrival] if later else -1)
    return waits


@pytest.mark.parametrize("seed", range(3))
def test_latencies_are_those_of_every_frame_played(seed: int) -> None:
    tables = tables_of(seed, 12)
    stream, asked = stream_of(tables, seed), 0.25
    pace = Pace(TABLED, asked * SLOW + (1 - asked) * QUICK, ("single",), float(SLOW), asked)
    waits = played(tables, stream, QUICK, SLOW)
    found = [max(wait, QUICK) for wait in waits if wait >= 0]
    told = latency_on_demand(tables, range(8), stream, pace)
    assert told.mean_us == pytest.approx(sum(found) / len(found))
    assert told.p99_us == sorted(found)[int(np.ceil(0.99 * len(found))) - 1]
    assert told.missed == waits.count(-1) / len(waits)


@pytest.mark.parametrize(("joint_steps", "step_us"), [(0, QUICK), (4000, SLOW)])
def test_where_all_frames_take_as_long_it_is_the_latency_of_such_frames(joint_steps: int, step_us: int) -> None:
    tables = tables_of(2, joint_steps)
    stream, asked = stream_of(tables, 2), float(step_us == SLOW)
    pace = Pace(TABLED, float(step_us), ("single",), float(SLOW), asked)
    assert latency_on_demand(tables, range(8), stream, pace) == latency(
        tables, range(8), stream, float(step_us), Policy(lead=0.0, dwell_us=0)
    )
