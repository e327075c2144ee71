import pytest

from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.frames import OLD_US
from thenar.runtime.posing import SETTLE_US, PoseGuide, PoseStage

HOLD_US = 1_000_000


@pytest.fixture
def guide() -> PoseGuide:
    return PoseGuide(SENSORS_18, HOLD_US)


def test_no_pose_is_taken_of_a_glove_that_is_silent(guide: PoseGuide) -> None:
    guide.press(0, "accept")
    guide.take(0, bytes([60] * 18))
    guide.press(OLD_US + 1, "accept")
    assert guide.offered(OLD_US + 1) == set()
    assert "accept" in guide.offered(OLD_US)
    guide.press(OLD_US, "accept")
    assert guide.stage == "held"


def hold(guide: PoseGuide, raw: bytes, now: int = 0) -> PoseStage:
    """Hold a pose to its end; before, and while it settles, the hand was elsewhere."""
    guide.take(now, bytes([200] * 18))
    guide.press(now, "accept")
    assert guide.stage == "held"
    guide.take(now + SETTLE_US - 1, bytes([200] * 18))
    for time_us in (SETTLE_US, SETTLE_US + HOLD_US - 1, SETTLE_US + HOLD_US):
        assert guide.stage == "held"
        guide.take(now + time_us, raw)
    return guide.stage


def test_a_doubtful_pose_is_held_again_or_kept(guide: PoseGuide) -> None:
    hold(guide, bytes([60] * 18))
    assert hold(guide, bytes([60] * 18)) == "doubted"
    assert "index_mpj went from 60 to 60 only: was the joint moved?" in guide.problems
    guide.press(0, "back")
    assert guide.stage == "doubted"
    guide.press(0, "accept")
    assert (guide.stage, guide.pose.name) == ("ready", "fist")
    assert hold(guide, bytes([60] * 18)) == "doubted"
    guide.press(0, "keep")
    assert (guide.stage, guide.pose.name) == ("ready", "bent thumb")


def test_saturated_dead_and_unmeasured_sensors_are_told(guide: PoseGuide) -> None:
    assert guide.states() == []
    index, thumb = SENSORS_18.index("index_mpj"), SENSORS_18.index("thumb_mpj")
    for number in range(2):
        raw = [60 + 60 * number] * 18
        raw[index] = raw[thumb] = 60
        guide.take(0, bytes(raw))
        guide.press(0, "accept")
        for time_us in (SETTLE_US, SETTLE_US + HOLD_US):
            guide.take(time_us, bytes(raw))
        guide.press(0, "keep")
    said = dict(zip(SENSORS_18, guide.states(), strict=True))
    # The thumb has not been asked to bend.
    assert {name: state for name, state in said.items() if state} == {"index_mpj": "dead: it never moved"}
    guide.take(0, bytes([0, 1, 255, *[100] * 15]))
    assert guide.states()[:4] == ["not measured", "at the end of its range", "at the end of its range", ""]
