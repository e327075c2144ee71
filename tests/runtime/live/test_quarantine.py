"""Inputs that lie: found against an exact model of all others, taken for lost, and used again."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace as changed

from thenar.runtime import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.live.quarantine import (
    CHATTERING,
    GRASPS,
    SETTLED_US,
    STUCK_CLOSED,
    STUCK_OPEN,
    StuckTest,
)
from thenar.runtime.live.recogniser import LiveRecognizer, Moment
from thenar.runtime.policy import Policy
from thenar.runtime.published import Quarantined
from thenar.runtime.scores import Scorer

MakeBuild = Callable[..., Build]

CLASSES, SWITCHES = 4, 12
GRASP_US = 3 * SETTLED_US
AT_ONCE = Policy(lead=0, dwell_us=0, hold_us=0)
SENSORS = ("j0", "j1", "j2")


def closing(seed: int = 3) -> np.ndarray:
    """Return how often each switch is closed in each type (s, K): seldom or nearly always."""
    return np.random.default_rng(seed).choice([0.05, 0.05, 0.5, 0.95], (SWITCHES, CLASSES))


def exact(make_build: MakeBuild, shares: np.ndarray, joints: int = 0) -> Build:
    """Return the build whose scores are the logarithms of the types' probabilities, were switches independent."""
    build = make_build(classes=CLASSES, switches=SWITCHES, joints=joints)
    rows = np.rint(100 * np.log(shares / (1 - shares))).astype(np.int16)
    bias = np.rint(100 * np.log(1 - shares).sum(axis=0)).astype(np.int16)
    means = np.rint(rows * shares.mean(axis=1, keepdims=True)).astype(np.int16)
    tables = build.tables.changed(bias=bias, switch_rows=rows, switch_means=means, scale=100.0)
    if joints:
        tables = tables.changed(joint_rows=tuple(np.zeros_like(row) for row in tables.joint_rows))
    counts = np.rint(255 * shares).astype(np.uint8)
    switches = tuple(
        changed(switch, closed_least=count.tobytes().hex(), closed_most=count.tobytes().hex())
        for switch, count in zip(build.manifest.switches, counts, strict=True)
    )
    return Build(changed(build.manifest, switches=switches), tables)


def drawn(shares: np.ndarray, grasps: int, seed: int) -> list[int]:
    """Return sets of switches as a hand closes them, the types at random."""
    random = np.random.default_rng(seed)
    closed = random.random((grasps, SWITCHES)) < shares[:, random.integers(CLASSES, size=grasps)].T
    return [sum(1 << switch for switch in np.flatnonzero(row).tolist()) for row in closed]


class Hand:
    """Grasps one thing after the other, with an open hand for a moment between them."""

    def __init__(self, build: Build, policy: Policy = AT_ONCE) -> None:
        self.live, self.now_us = LiveRecognizer(build, switch_period_us=GRASP_US, policy=policy), 0

    def grasp(self, closed: int, stuck: int = 0, dead: int = 0) -> Moment:
        for pause_us, shown in ((SETTLED_US // 2, 0), (SETTLED_US, closed), (GRASP_US, closed)):
            frame = SwitchFrame(self.now_us, (shown | stuck) & ~dead)
            moment = self.live.step(self.now_us, 0, frame, None)
            self.now_us += pause_us
        return moment

    @property
    def found(self) -> tuple[Quarantined, ...]:
        # What a grasp brought is known at the next step.
        self.live.step(self.now_us, 0, None, None)
        return self.live.quarantine.found


def test_evidence_is_the_ratio_of_the_probabilities_of_what_is_shown(make_build: MakeBuild) -> None:
    """Against sums over all types in floating point, of a switch that is stuck closed."""
    shares = closing()
    build, scorer = exact(make_build, shares), Scorer(exact(make_build, shares).tables)
    for closed in drawn(shares, 40, 1):
        test = StuckTest(build)
        bits = np.array([closed >> switch & 1 for switch in range(SWITCHES)], bool)
        test.weigh(scorer.biased_scores(bits, []), closed, (1 << SWITCHES) - 1, 0)
        for switch in np.flatnonzero(bits):
            others = np.arange(SWITCHES) != switch
            likely = np.where(bits[:, np.newaxis], shares, 1 - shares)[others].prod(axis=0)
            # The mean row is a constant for each type, which the score without the switch holds.
            likely *= np.exp((build.tables.switch_means[switch] + 0.0) / 100) * (1 - shares[switch])
            explained = max((likely * shares[switch]).sum() / likely.sum(), 1 / 20)
            assert test.sums[0, switch] == pytest.approx(max(16 * math.log((31 / 32) / explained), 0), abs=3)
        assert not test.sums[0, ~bits].any()


@pytest.mark.parametrize("seed", range(4))
def test_a_model_that_holds_gives_no_more_false_alarms_than_stated(make_build: MakeBuild, seed: int) -> None:
    """One in GRASPS at most, in the mean: two in half as many have a chance below 10 %, four below 0.2 %."""
    shares, alarms = closing(seed), 0
    hand = Hand(exact(make_build, shares))
    for closed in drawn(shares, GRASPS // 2, seed):
        before = set(hand.found)
        hand.grasp(closed)
        alarms += len(set(hand.found) - before)
    assert alarms < 2


@pytest.mark.parametrize("switch", range(SWITCHES))
def test_a_switch_stuck_closed_is_lost_until_it_opens(make_build: MakeBuild, switch: int) -> None:
    shares = closing()
    hand, grasps = Hand(exact(make_build, shares)), iter(drawn(shares, 400, switch))
    name, bit = f"s{switch}", 1 << switch
    for _ in range(20):
        assert hand.grasp(next(grasps)).grasp.health == "ok"
    for _ in range(30):
        last = hand.grasp(next(grasps), stuck=bit).grasp
    assert hand.found == (Quarantined(name, STUCK_CLOSED),)
    assert (last.health, last.lost) == ("degraded", (name,))
    for _ in range(30):
        last = hand.grasp(next(grasps)).grasp
    assert [*hand.found] == []
    assert (last.health, last.lost) == ("ok", ())


def test_a_switch_that_opens_with_the_hand_is_never_stuck_closed(make_build: MakeBuild) -> None:
    """Whatever its owner does: here every grasp closes a switch that no recording shows closed. If it stays closed
    while the hand is open, it is found by the third grasp.
    """
    shares = closing()
    shares[3] = 0.004
    hand, grasps = Hand(exact(make_build, shares)), iter(drawn(shares, 100, 4))
    for _ in range(60):
        hand.grasp(next(grasps) | 8)
        assert [*hand.found] == []
    for _ in range(3):
        hand.grasp(next(grasps), stuck=8)
    assert hand.found == (Quarantined("s3", STUCK_CLOSED),)


def test_a_switch_that_stops_closing_is_stuck_open(make_build: MakeBuild) -> None:
    shares = np.full((SWITCHES, CLASSES), 0.05)
    for label in range(CLASSES):
        shares[3 * label : 3 * label + 3, label] = 0.95
    build, grasps = exact(make_build, shares), iter(drawn(shares, 600, 5))
    hand = Hand(build)
    for _ in range(60):
        hand.grasp(next(grasps))
    for _ in range(100):
        hand.grasp(next(grasps), dead=1)
    assert hand.found == (Quarantined("s0", STUCK_OPEN),)
    for _ in range(60):
        hand.grasp(next(grasps))
    assert [*hand.found] == []
    # A hand that never closes a switch looks the same: nobody can tell.
    hand = Hand(build)
    for _ in range(100):
        hand.grasp(next(grasps), dead=1)
    assert [*hand.found] == []


def test_a_fault_is_not_blamed_on_other_switches(make_build: MakeBuild) -> None:
    """Weighed without the switch that is stuck, no other has any evidence left that would have been its."""
    shares = closing(8)
    hand = Hand(exact(make_build, shares))
    for closed in drawn(shares, 40, 2):
        hand.grasp(closed, stuck=1)
        assert {one.name for one in hand.found} <= {"s0"}
    assert hand.found


def test_no_more_is_left_out_than_the_answer_can_do_without(make_build: MakeBuild) -> None:
    """Of all switches stuck closed those are used that hold half of the weight; a lost one counts, too."""
    shares = closing()
    build = exact(make_build, shares)
    hand = Hand(build)
    chatter = (1 << SWITCHES) - 1
    for number in range(60):
        hand.live.step(hand.now_us, 0, SwitchFrame(hand.now_us, chatter * (number % 2)), None)
        hand.now_us += 5000
    found, weights = hand.found, np.abs(build.tables.switch_rows.astype(int)).sum(axis=1)
    assert [one.name for one in found] == [f"s{switch}" for switch in range(SWITCHES)]
    assert {one.reason for one in found} == {CHATTERING}
    out = [one.used is False for one in found]
    assert 0 < weights[out].sum() <= weights.sum() / 2 < weights.sum() - weights[out].sum() + 1
    moment = hand.live.step(hand.now_us, 0, SwitchFrame(hand.now_us, 0), None)
    assert moment.grasp.health == "degraded"
    assert moment.grasp.lost == tuple(one.name for one in found if not one.used)
    before = hand.found
    lost = 1 << int(np.flatnonzero(~np.array(out))[0])
    moment = hand.live.step(hand.now_us + 1, 0, SwitchFrame(hand.now_us + 1, 0, lost), None)
    assert moment.grasp.health == "degraded"
    assert {one.name for one in hand.found} == {one.name for one in before}


def test_while_all_is_lost_what_is_in_quarantine_stays_there(make_build: MakeBuild) -> None:
    """A stall of the host is no news of the switch."""
    shares = closing()
    hand = Hand(exact(make_build, shares))
    for closed in drawn(shares, 40, 3):
        hand.grasp(closed, stuck=1)
    found = hand.found
    moment = hand.live.step(hand.now_us + 10 * GRASP_US, 0, None, None)
    assert moment.grasp.health == "unknown"
    assert found == hand.live.quarantine.found == (Quarantined("s0", STUCK_CLOSED),)


def test_without_quarantine_the_fault_is_named_and_nothing_is_left_out(make_build: MakeBuild) -> None:
    shares = closing()
    hand, grasps = Hand(exact(make_build, shares), changed(AT_ONCE, quarantine=False)), drawn(shares, 40, 3)
    for closed in grasps:
        last = hand.grasp(closed, stuck=1).grasp
    assert hand.found == (Quarantined("s0", STUCK_CLOSED, used=True),)
    assert (last.health, last.lost) == ("ok", ())


def test_builds_without_closing_rates_find_no_stuck_switch(make_build: MakeBuild) -> None:
    hand = Hand(make_build(classes=CLASSES, switches=SWITCHES, joints=0))
    for closed in drawn(closing(), 60, 3):
        hand.grasp(closed, stuck=1)
    assert [*hand.found] == []


def test_a_held_or_repeated_grasp_is_one_observation(make_build: MakeBuild) -> None:
    shares = closing()
    hand, (closed, *_) = Hand(exact(make_build, shares)), drawn(shares, 1, 3)
    for number in range(2000):
        now_us = number * SETTLED_US
        # One of many contacts comes and goes.
        hand.live.step(now_us, 0, SwitchFrame(now_us, closed | 0b111_111 | (number % 2) << 11), None)
    assert hand.live.quarantine.found == ()


def test_a_grasp_is_one_observation_however_often_its_switches_cannot_be_read(make_build: MakeBuild) -> None:
    """As those of a board whose datagrams get lost: all of them are unknown until it was asked."""
    shares = closing()
    # Every switch is closed, also those that no recording closes; it lasts for 100 s.
    hand, every = Hand(exact(make_build, shares)), (1 << SWITCHES) - 1
    for number in range(1000):
        for later_us, lost in ((0, every), (SETTLED_US // 5, 0), (6 * SETTLED_US // 5, 0)):
            now_us = number * 2 * SETTLED_US + later_us
            hand.live.step(now_us, 0, SwitchFrame(now_us, 0 if lost else every, lost), None)
    assert hand.live.quarantine.found == ()


def test_a_stuck_switch_is_found_despite_unread_switches(make_build: MakeBuild) -> None:
    shares, every = closing(), (1 << SWITCHES) - 1
    hand = Hand(exact(make_build, shares))
    for closed in drawn(shares, 40, 3):
        hand.grasp(closed, stuck=1)
        hand.live.step(hand.now_us, 0, SwitchFrame(hand.now_us, 0, every), None)
        hand.now_us += SETTLED_US // 10
    assert hand.found == (Quarantined("s0", STUCK_CLOSED),)


def chattering(live: LiveRecognizer, start_us: int, frames: int, every: int, period_us: int = 5000) -> list[bool]:
    """Change switch 0 every so many frames; return whether it is lost."""
    lost = []
    for number in range(frames):
        now_us = start_us + number * period_us
        grasp = live.step(now_us, 0, SwitchFrame(now_us, number // every % 2), None).grasp
        lost.append("s0" in grasp.lost)
    return lost


@pytest.mark.parametrize(("every", "chatters"), [(1, True), (5, True), (10, False), (40, False)])
def test_a_chattering_switch_is_lost_until_it_is_quiet(make_build: MakeBuild, every: int, chatters: bool) -> None:
    """200, 40, 20 and 5 changes a second: a hand can do 20."""
    live = LiveRecognizer(make_build(), switch_period_us=5000, policy=Policy(max_lost=1.0))
    lost = chattering(live, 0, 800, every)
    assert lost[-1] is chatters
    assert sum(one != other for one, other in pairwise(lost)) == chatters
    assert not chatters or lost.index(True) * 5000 <= 1_100_000
    quiet = chattering(live, 4_000_000, 1000, 2000)
    assert not quiet[-1]
    assert quiet.index(False) <= 2_000_000 // 5000 + 1
