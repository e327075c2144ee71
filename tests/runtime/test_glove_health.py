from collections.abc import Callable

import msgspec
import pytest
from msgspec.structs import replace as changed

from thenar.runtime import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.glove import GloveHealth
from thenar.runtime.live.quarantine import Chattering, Quarantine
from thenar.runtime.published import UNKNOWN, Count, DeviceHealth, HealthReport, LiveGrasp

MakeBuild = Callable[..., Build]

SECOND = 1_000_000


@pytest.fixture
def build(make_build: MakeBuild) -> Build:
    return make_build(switches=4, joints=2)


def health_of(build: Build) -> GloveHealth:
    return GloveHealth(Quarantine(build, lambda _switches, _joints: True))


def grasp(name: str, health: str = "ok") -> LiveGrasp:
    known = LiveGrasp(0, 0, 0, name, name, 0.9, 5, "ok", 0, 0, 0)
    return changed(known, health=health)


def test_a_switch_recovers_while_another_still_chatters() -> None:
    chattering, found = Chattering(2), []
    for number in range(400):
        chattering.frame(number * SECOND // 100, 0b11 * (number % 2) & (0b11 if number < 120 else 0b10), 0b11)
        found.append(chattering.switches)
    assert (found[119], found[-1]) == (0b11, 0b10)
    alone = Chattering(1)
    for number in range(400):
        alone.frame(number * SECOND // 100, number % 2 if number < 120 else 0, 1)
        assert alone.switches == found[number] & 1


def test_a_closed_switch_read_now_and_then_does_not_chatter() -> None:
    chattering = Chattering(1)
    for number in range(250):
        chattering.frame(number * SECOND // 100, 1 - number % 2, 1 - number % 2)
    assert chattering.switches == 0


def test_faults_are_those_of_the_quarantine(build: Build) -> None:
    quarantine = Quarantine(build, lambda _switches, _joints: True)
    health = GloveHealth(quarantine)
    for number in range(120):
        quarantine.look(SwitchFrame(number * SECOND // 100, number % 2 << 1), (0, 0, 0, 0), 0)
    quarantine.left_out(0, 0)
    report = health.report(0)
    assert [(one.name, one.reason) for one in report.quarantined] == [("s1", "chattering")]


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
