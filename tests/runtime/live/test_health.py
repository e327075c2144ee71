from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace as changed

from thenar.runtime import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.live.health import Health, on_shares, patience
from thenar.runtime.live.quarantine import Chattering, JointDrift, Quarantine
from thenar.runtime.published import UNKNOWN, Count, DeviceHealth, Drift, HealthReport, LiveGrasp

MakeBuild = Callable[..., Build]

SHARES = (0.25, 0.5, 0.9, 0.75)
SECOND = 1_000_000


@pytest.fixture
def build(make_build: MakeBuild) -> Build:
    """Four switches that were on in the SHARES of the recordings, four grasp types, two joints."""
    made = make_build(switches=4, joints=2)
    switches = tuple(
        changed(switch, closed_share=share) for switch, share in zip(made.manifest.switches, SHARES, strict=True)
    )
    return Build(changed(made.manifest, switches=switches), made.tables)


def health_of(build: Build) -> Health:
    return Health(build, Quarantine(build, lambda _switches, _joints: True))


def grasp(name: str, health: str = "ok") -> LiveGrasp:
    known = LiveGrasp(0, 0, 0, name, name, 0.9, 5, "ok", 0, 0, 0)
    return changed(known, health=health)


def hold(health: Health, grasps: list[str], closed: Callable[[int], int], lost: int = 0) -> None:
    """Hold one grasp after the other for three frames each."""
    start = health.report(0).frames * 100
    for number, name in enumerate(grasps):
        for frame in range(3):
            time_us = start + number * 300 + frame * 100
            health.update(grasp(name), SwitchFrame(time_us, closed(number), lost))


def of_types(build: Build, count: int, types: int = 4) -> list[str]:
    return [build.grasps[number % types] for number in range(count)]


def test_shares_of_on_are_those_of_the_build(build: Build) -> None:
    assert on_shares(build) == list(SHARES)
    untold = tuple(changed(switch, closed_share=None) for switch in build.manifest.switches)
    assert all(np.isnan(on_shares(Build(changed(build.manifest, switches=untold), build.tables))))


def test_patience_is_the_number_of_misses_that_chance_does_not_explain() -> None:
    assert patience(0.5) == 14
    assert 0.5**14 <= 1e-4 < 0.5**13
    assert patience(1.0) == 1
    assert patience(0.0) == patience(float("nan")) == np.inf


def test_switches_that_work_are_never_suspected(build: Build) -> None:
    health, random = health_of(build), np.random.default_rng(2)
    patterns = [sum(1 << s for s in range(4) if random.random() < SHARES[s]) for _ in range(500)]
    hold(health, of_types(build, 500), lambda number: patterns[number])
    report = health.report(10**9)
    assert (report.stuck_open, report.stuck_closed) == ((), ())


def test_stuck_switches_are_named_once_chance_is_ruled_out(build: Build) -> None:
    """Switch 1 never closes, switch 0 never opens; the others do both. A grasp counts once it is over."""
    health = health_of(build)
    hold(health, of_types(build, 14), lambda number: 0b1101 if number % 2 else 0b0001)
    assert health.report(0).stuck_open == ()
    hold(health, of_types(build, 1), lambda number: 0b1101)
    report = health.report(0)
    assert (report.stuck_open, report.stuck_closed) == (("s1",), ("s0",))
    hold(health, of_types(build, 2), lambda number: 0b1110)
    report = health.report(0)
    assert (report.stuck_open, report.stuck_closed) == ((), ())


def test_one_grasp_held_or_repeated_for_long_suspects_nobody(build: Build) -> None:
    for grasps in ([build.grasps[0]] * 400, [build.grasps[0], UNKNOWN] * 200):
        health = health_of(build)
        hold(health, grasps, lambda number: 0)
        assert health.report(0).stuck_open == ()


def test_half_of_the_types_are_enough_to_suspect_a_switch(build: Build) -> None:
    health = health_of(build)
    hold(health, of_types(build, 60, types=2), lambda number: 0)
    assert health.report(0).stuck_open == ("s0", "s1", "s2", "s3")


def test_unread_switches_become_no_more_suspect(build: Build) -> None:
    health = health_of(build)
    hold(health, of_types(build, 8), lambda number: 0)
    hold(health, of_types(build, 100), lambda number: 0, lost=0b0010)
    assert health.report(0).stuck_open == ("s0", "s2", "s3")


def test_a_switch_that_changes_faster_than_a_hand_chatters() -> None:
    chattering = Chattering(4)
    for number in range(120):
        closed = (number & 1) | (number // 10 & 1) << 1
        chattering.frame(number * SECOND // 100, closed, 0b1111)
    assert chattering.switches == 0b1
    for number in range(120, 350):
        chattering.frame(number * SECOND // 100, 0, 0b1111)
    assert chattering.switches == 0


def test_a_closed_switch_read_now_and_then_does_not_chatter() -> None:
    chattering = Chattering(1)
    for number in range(250):
        chattering.frame(number * SECOND // 100, 1 - number % 2, 1 - number % 2)
    assert chattering.switches == 0


def moving(drift: JointDrift, minutes: int, first: int, shift: int, narrow: int = 0) -> None:
    """Move joint 0 between two ends, and joint 1 between 50 and 150, a frame a second."""
    for second in range(minutes * 60 + 1):
        up = second % 2
        codes = [100 + shift + 100 * up + (-narrow if up else narrow), 50 + 100 * up]
        drift.frame((first * 60 + second) * SECOND, codes)


@pytest.mark.parametrize(
    ("shift", "narrow", "drifting"),
    [(0, 0, 0), (20, 0, 0), (21, 0, 21), (-40, 0, -40), (0, 30, 0), (0, -30, 0)],
)
def test_a_joint_drifts_when_both_ends_move_the_same_way(build: Build, shift: int, narrow: int, drifting: int) -> None:
    drift = JointDrift(build.tables)
    moving(drift, 1, 0, 0)
    assert not any(drift.codes)
    moving(drift, 3, 1, shift, narrow)
    assert drift.codes == (drifting, 0)


def test_chattering_and_drift_are_those_of_the_quarantine(build: Build) -> None:
    quarantine = Quarantine(build, lambda _switches, _joints: True)
    health = Health(build, quarantine)
    quarantine.chattering.switches, quarantine.drift.codes = 0b10, (0, 7)
    report = health.report(0)
    assert (report.chattering, report.drifting) == (("s1",), (Drift("j1", 7),))


@pytest.mark.parametrize("hz", [10, 100, 333])
def test_rates_are_of_the_last_second_and_fall_with_silence(build: Build, hz: int) -> None:
    health = health_of(build)
    assert (health.report(0).switch_hz, health.report(0).glove_hz) == (0, 0)
    for number in range(3 * hz + 1):
        now = number * SECOND // hz
        frame = SwitchFrame(now, 0)
        for _ in range(2):
            health.update(grasp("a"), frame, now if number % 2 else None)
    report = health.report(3 * SECOND)
    assert report.switch_hz == pytest.approx(hz, rel=0.02)
    assert report.glove_hz == pytest.approx(hz / 2, rel=0.2)
    assert health.report(8 * SECOND).switch_hz < 1


def test_a_report_counts_answers_and_carries_what_drivers_count(build: Build) -> None:
    health = health_of(build)
    for kind, times in (("ok", 3), ("changing", 4), ("degraded", 2), ("unknown", 1)):
        for _ in range(times):
            health.update(grasp(UNKNOWN, kind), None)
    devices = [DeviceHealth("stream", connected=False, error="gone", counts=(Count("crc", 4),))]
    report = health.report(77, devices)
    assert (report.time_us, report.frames, report.changing, report.degraded, report.unknown) == (77, 10, 4, 2, 1)
    assert report.devices == tuple(devices)
    assert msgspec.json.decode(msgspec.json.encode(report), type=HealthReport) == report
