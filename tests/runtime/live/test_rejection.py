"""A build that refuses frames says "none" of them, by the same decisions as of any type, and segments know it."""

import math
from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.live.recogniser import LiveRecognizer
from thenar.runtime.manifest import Rejection
from thenar.runtime.policy import Policy
from thenar.runtime.published import NONE, LiveGrasp

MakeBuild = Callable[..., Build]

SWITCHES = 6
PERIOD = 1000
# Of 6 switches 2 to 4 are closed in a grasp.
CLOSED = (2, 4)
HELD, EMPTY, FULL = 0b000111, 0b000001, 0b011111
masks = st.integers(0, (1 << SWITCHES) - 1)


@pytest.fixture
def build(make_build: MakeBuild) -> Build:
    return refusing(make_build(joints=0))


def refusing(plain: Build, share: float = 0.01) -> Build:
    n, joints = len(plain.grasps), len(plain.manifest.joints)
    rejection = Rejection(
        share=share,
        least_scores=(-32768,) * n,
        closed=(CLOSED,) * n,
        ranges=(((0, 65535),) * joints,) * n,
        outside=0,
    )
    return Build(msgspec.structs.replace(plain.manifest, rejection=rejection), plain.tables)


def recognizer(build: Build, policy: Policy | None = None) -> LiveRecognizer:
    return LiveRecognizer(build, switch_period_us=PERIOD, policy=policy or Policy(lead=0, dwell_us=0, hold_us=0))


def flags(closed: int) -> list[bool]:
    return [bool(closed >> switch & 1) for switch in range(SWITCHES)]


def lasting(live: LiveRecognizer, closed: int, ms: int, begin_us: int, lost: int = 0) -> list[LiveGrasp]:
    times = range(begin_us, begin_us + 1000 * ms, 1000)
    return [live.step(now, 0, SwitchFrame(now, closed, lost), None).grasp for now in times]


@given(closed=masks)
def test_refused_frames_are_none_others_as_the_tables_say(make_build: MakeBuild, closed: int) -> None:
    plain = make_build(joints=0)
    build = refusing(plain)
    found = recognizer(build).step(0, 0, SwitchFrame(0, closed), None).grasp
    if CLOSED[0] <= closed.bit_count() <= CLOSED[1]:
        assert found.grasp == found.candidate != NONE
        expected = recognizer(plain).step(0, 0, SwitchFrame(0, closed), None).grasp
        assert (found.grasp, found.probability, found.margin) == (
            expected.grasp,
            expected.probability,
            expected.margin,
        )
    else:
        assert (found.grasp, found.candidate, found.health) == (NONE, NONE, "ok")
    alone = build.recognise(flags(closed), [])
    assert (alone.grasp, alone.probability, alone.margin) == (found.grasp, found.probability, found.margin)
    assert build.classify(flags(closed), []) == found.grasp
    if found.grasp == NONE:
        assert found.margin == math.ceil(build.tables.scale * math.log(99))
        # The types share what is left, of which the best has 1 against 99.
        assert 0.99 ** len(build.grasps) < found.probability < 0.99 + 1e-4


def test_none_is_decided_on_like_any_type(build: Build) -> None:
    live = recognizer(build, Policy(dwell_us=50_000, hold_us=500_000))
    held = lasting(live, HELD, 200, 0)
    empty = lasting(live, EMPTY, 200, 200_000)
    again = lasting(live, HELD, 200, 400_000)
    for before, after in ((held, empty), (empty, again)):
        assert {one.grasp for one in after[:50]} == {before[-1].grasp}
        assert {one.health for one in after[:50]} == {"changing"}
        assert {(one.grasp, one.health) for one in after[50:]} == {(after[-1].candidate, "ok")}
    assert held[-1].grasp == again[-1].grasp != empty[-1].grasp == NONE


def test_segments_begin_and_end_where_frames_are_refused_no_longer(build: Build) -> None:
    live = recognizer(build, Policy(dwell_us=0, hold_us=0, lag_us=150_000))
    states = [
        [(one.state, one.segment) for one in lasting(live, closed, 500, begin)]
        for begin, closed in enumerate((EMPTY, HELD, EMPTY, HELD, FULL))
        for begin in [500_000 * begin]
    ]
    assert [each[-1] for each in states] == [("none", 0), ("held", 1), ("none", 1), ("held", 2), ("none", 2)]


def test_lost_switches_refuse_nothing_by_being_lost(build: Build) -> None:
    live = recognizer(build, Policy(lead=0, dwell_us=0, hold_us=0, max_lost=1.0))
    # One is closed, and another may be.
    assert build.recognise(flags(EMPTY), [], flags(0b010000)).grasp != NONE
    assert build.recognise(flags(0), [], flags(0b010000)).grasp == NONE
    assert lasting(live, EMPTY, 1, 0, lost=0b010000)[0].grasp != NONE
    assert lasting(live, 0, 1, 1000, lost=0b010000)[0].grasp == NONE


def test_a_lost_switch_is_not_counted_as_closed(build: Build) -> None:
    lost = np.array(flags(0b000001))
    assert build.recognise(flags(FULL), []).grasp == NONE
    found = build.recognise(flags(FULL), [], lost_switches=lost)
    assert (found.grasp != NONE, found.degraded) == (True, True)
    assert build.recognise(flags(0b000011), [], lost_switches=np.array(flags(0b111100))).grasp != NONE
    assert build.recognise(flags(0b000001), [], lost_switches=lost & False).grasp == NONE
