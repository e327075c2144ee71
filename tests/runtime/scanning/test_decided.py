"""Decided or not: against every state of every unread switch, and against what the runtime does."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from thenar.runtime.errors import FrameError
from thenar.runtime.scanning.decided import Decided, EarlyExit, reach_of
from thenar.runtime.scores import Scorer, joint_reaches
from thenar.runtime.tables import IntegerTables, Pair

MakeTables = Callable[..., IntegerTables]


def small_tables(seed: int) -> IntegerTables:
    """Few classes and small steps, so that ties are common; means that need not lie between open and closed."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-2, 3, shape).astype(np.int16)

    step = (np.array([100], np.uint16),)
    return IntegerTables(rows(3), rows(5, 3), step, (rows(2, 3),), rows(5, 3), rows(1, 3), 1.0)


@pytest.mark.parametrize("seed", range(6))
def test_a_frame_is_decided_exactly_when_every_state_of_the_unread_has_the_same_winner(seed: int) -> None:
    tables, ports = small_tables(seed), [[0], [3, 1], [4]]  # switch 2 is on no port: it is known
    bits = np.array(list(product([False, True], repeat=5)) * 2)
    codes = np.repeat([[100], [101]], 32, axis=0).astype(np.uint16)
    frames, scorer = Decided(tables, ports, bits, codes), Scorer(tables)
    for read in range(8):
        unread = [switch for number, port in enumerate(ports) if not read >> number & 1 for switch in port]
        leaders, decided = frames.after(read)
        for row, (frame, code) in enumerate(zip(bits, codes, strict=True)):
            winners = set()
            for states in product(("open", "closed", "lost"), repeat=len(unread)):
                closed, lost = frame.copy(), np.zeros(5, bool)
                closed[unread] = [state == "closed" for state in states]
                lost[unread] = [state == "lost" for state in states]
                lanes = scorer.lanes_without(closed, code, lost, [False])
                winners.add(lanes.index(max(lanes)))
            assert decided[row] == (len(winners) == 1)
            if decided[row]:
                assert winners == {leaders[row]}
        assert frames.undecided(read) == np.count_nonzero(~decided)


@pytest.mark.parametrize("seed", range(3))
def test_the_plan_and_the_runtime_mean_the_same_by_decided(make_tables: MakeTables, seed: int) -> None:
    tables = make_tables(seed=seed, classes=6, switches=12, joints=3)
    random = np.random.default_rng(seed)
    ports = [list(map(int, part)) for part in np.split(random.permutation(12), [2, 3, 7, 9])]
    bits, codes = random.random((60, 12)) < 0.4, random.integers(0, 256, (60, 3)).astype(np.uint16)
    frames = Decided(tables, ports, bits, codes)
    early = EarlyExit(Scorer(tables), [sum(1 << switch for switch in port) for port in ports])
    seen = set()
    for row in range(60):
        early.start(codes[row].tolist())
        closed = sum(1 << switch for switch in np.flatnonzero(bits[row]).tolist())
        for number in range(len(ports)):
            stops = bool(frames.after((2 << number) - 1)[1][row])
            assert early.after(number, closed) == stops
            seen.add(stops)
    assert seen == {False, True}


def test_everything_read_is_decided_and_the_leader_is_the_winner(make_tables: MakeTables) -> None:
    tables = make_tables()
    random = np.random.default_rng(0)
    bits, codes = random.random((40, 9)) < 0.5, random.integers(0, 256, (40, 3)).astype(np.uint16)
    frames, scorer = Decided(tables, [[0, 1, 2, 3], [4, 5, 6, 7, 8]], bits, codes), Scorer(tables)
    leaders, decided = frames.after(3)
    assert decided.all()
    lanes = [scorer.lanes(*frame) for frame in zip(bits, codes, strict=True)]
    assert leaders.tolist() == [lane.index(max(lane)) for lane in lanes]
    assert len(frames) == 40


def test_the_reach_of_switches_is_the_most_that_one_class_can_gain_on_another() -> None:
    rows = np.array([[5, 0, -1], [0, 3, 0]], np.int16)
    means = np.array([[0, 0, 0], [9, 0, 0]], np.int16)
    tables = IntegerTables(np.zeros(3, np.int16), rows, (), (), means, np.zeros((0, 3), np.int16), 1.0)
    # Switch 0 closed: class 0 gains 6 on class 2. Switch 1 lost: class 0 gains 9.
    assert [reach_of(tables, some) for some in ([], [0], [1], [0, 1])] == [0, 6, 9, 15]


@pytest.mark.parametrize("shapes", [((4, 8), (4, 3)), ((4, 9), (4, 2)), ((4, 9), (3, 3))])
def test_frames_that_do_not_fit_the_tables_are_refused(
    make_tables: MakeTables, shapes: tuple[tuple[int, int], tuple[int, int]]
) -> None:
    bits, codes = np.zeros(shapes[0], bool), np.zeros(shapes[1], np.uint16)
    with pytest.raises(FrameError, match="the build has 9 switches and 3 joints"):
        Decided(make_tables(), [[0]], bits, codes)


@pytest.mark.parametrize("lead", [0, 2])
@pytest.mark.parametrize("seed", range(4))
def test_on_demand_the_record_is_left_out_exactly_when_no_state_of_the_joints_changes_the_winner(
    seed: int, lead: int
) -> None:
    """Against every state of the switches on ports not yet read, and every bin of the joint, or its loss."""
    small, ports = small_tables(seed), [[0], [3, 1], [4, 2]]
    tables = replace(small, switch_rows=(5 * small.switch_rows).astype(np.int16))  # else the joint always matters
    scorer = Scorer(tables)
    early = EarlyExit(scorer, [sum(1 << switch for switch in port) for port in ports], lead=lead, on_demand=True)
    seen = set()
    for bits in product([False, True], repeat=5):
        early.start([100])  # codes of an earlier record: nothing may rest on them
        closed = sum(bit << switch for switch, bit in enumerate(bits))
        for number in range(3):
            unread = [switch for port in ports[number + 1 :] for switch in port]
            standings = set()
            for states in product(("open", "closed", "lost"), repeat=len(unread)):
                frame, lost = np.array(bits), np.zeros(5, bool)
                frame[unread] = [state == "closed" for state in states]
                lost[unread] = [state == "lost" for state in states]
                for code, gone in ((100, False), (101, False), (0, True)):
                    lanes = scorer.lanes_without(frame, [code], lost, [gone])
                    second, best = sorted(lanes)[-2:]
                    standings.add((lanes.index(best), best - second >= lead))
            winners, sure = {winner for winner, _ in standings}, all(leads for _, leads in standings)
            assert early.after(number, closed) == (len(winners) == 1 and sure)
            assert not early.unread(number) & scorer.joints_bit
            seen.add(len(winners) == 1 and sure)
    assert seen == {False, True}


@pytest.mark.parametrize("seed", range(4))
def test_joints_of_a_pair_reach_as_far_as_they_can_say_together(seed: int) -> None:
    """Against every bin of every joint, read or lost."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-9, 10, (*shape, 3)).astype(np.int16)

    steps = tuple(np.sort(random.choice(20, 2, replace=False)).astype(np.uint16) for _ in range(5))
    pair = Pair((0, 2), (steps[3], steps[4]), rows(3, 3))
    tables = IntegerTables(
        rows(), rows(0), steps[:3], (rows(3), rows(3), rows(3)), rows(0), rows(3), 1.0, pairs=(pair,)
    )
    scorer, each = Scorer(tables), range(22)
    unread = np.array(scorer.lanes_without([], [0, 0, 0], [], [True] * 3))
    codes = [sorted({0, *(int(step) + 1 for step in tables.steps_of(joint))} & set(each)) for joint in range(3)]
    said = [
        np.array(scorer.lanes_without([], list(frame), [], list(lost))) - unread
        for frame in product(*codes)
        for lost in product([False, True], repeat=3)
    ]
    for leader in range(3):
        assert joint_reaches(tables, leader).tolist() == np.max([one - one[leader] for one in said], axis=0).tolist()
    assert (tables.jointless + 2**15 == unread).all()
