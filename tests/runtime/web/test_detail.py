"""What people see of a moment is what the build makes of it."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.runtime.build import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.live.recogniser import Moment
from thenar.runtime.manifest import Calibration, Rejection
from thenar.runtime.published import LiveGrasp
from thenar.runtime.web.live import FrameText

MakeBuild = Callable[..., Build]
MakeGrasp = Callable[..., LiveGrasp]
CLOCK_US = 1_700_000_000_000_000


def shown(build: Build, moment: Moment) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(FrameText(build, Harness(name="x"))(moment, CLOCK_US))
    return found


def mask(bits: np.ndarray) -> int:
    return sum(1 << number for number, bit in enumerate(bits) if bit)


@pytest.mark.parametrize("seed", range(5))
def test_probabilities_are_those_of_the_build_and_joints_are_in_their_unit(
    make_build: MakeBuild, make_grasp: MakeGrasp, seed: int
) -> None:
    made = make_build(seed)
    degrees = tuple(
        Calibration(number, f"j{number}", "deg", 10, -5.0, 210, 95.0) for number in range(made.tables.n_joints)
    )
    least = (-32768,) * made.tables.n_classes
    rejection = Rejection(0.01, least, ((0, 6),) * len(least), (((0, 255),) * 3,) * len(least), 3)
    random = np.random.default_rng(seed)
    for build in (made, Build(replace(made.manifest, joints=degrees, rejection=rejection), made.tables)):
        bits, codes = random.random(6) < 0.5, random.integers(1, 256, 3)
        frame = SwitchFrame(0, mask(bits))
        scores = build.scorer.biased_scores(bits, codes)
        moment = Moment(make_grasp(7), frame, None, codes.tolist(), scores=scores)
        detail = shown(build, moment)
        assert [letter == "1" for letter in detail["closed"]] == bits.tolist()
        found = build.recognise(bits, codes)
        assert len(detail["probabilities"]) == len(build.manifest.classes)
        at = build.manifest.classes.index(found.grasp)
        assert detail["probabilities"][at] == max(detail["probabilities"]) == pytest.approx(found.probability, abs=6e-5)
        expected = codes if build is made else -5.0 + (codes - 10) / 2
        assert detail["joints"] == pytest.approx(expected.tolist())


def test_a_refused_frame_shows_that_nothing_is_held(make_build: MakeBuild, make_grasp: MakeGrasp) -> None:
    made = make_build(1)
    rejection = Rejection(0.01, (0,) * 4, ((0, 6),) * 4, (((0, 255),) * 3,) * 4, 3)
    build = Build(replace(made.manifest, rejection=rejection), made.tables)
    scores = build.scorer.biased_scores([True] * 6, [9, 9, 9])
    shares = [
        shown(build, Moment(make_grasp(), None, None, None, scores=scores, refused=refused))["probabilities"]
        for refused in (False, True)
    ]
    assert shares[0][-1] == 0.0
    assert shares[1][-1] == max(shares[1]) > 0.7


def test_before_anything_was_read_nothing_is_claimed(make_build: MakeBuild, make_grasp: MakeGrasp) -> None:
    detail = shown(make_build(), Moment(make_grasp(), None, None, None))
    assert (detail["closed"], detail["joints"], detail["probabilities"]) == ("000000", None, None)


@pytest.mark.parametrize("health", ["ok", "changing", "degraded", "unknown"])
@pytest.mark.parametrize("state", ["none", "forming", "held", "releasing"])
def test_timelines_show_a_moment_by_times_since_1970(
    make_build: MakeBuild, make_grasp: MakeGrasp, health: str, state: str
) -> None:
    """A segment that forms may be revoked, and what is read in whole is no trouble."""
    began_us = None if state == "none" else 1_000
    grasp = replace(make_grasp(), time_us=3_000, health=health, state=state, segment_us=began_us, segment_type="hook")
    moment = shown(make_build(), Moment(grasp, None, None, None))
    segment = ["hook", CLOCK_US + 1_000] if state in ("held", "releasing") else ["", None]
    trouble = health if health in ("degraded", "unknown") else ""
    assert moment["change"] == [CLOCK_US + 3_000, grasp.grasp, trouble, *segment]
    # What sinks send stays as it is.
    assert (moment["time_us"], moment["segment_us"]) == (3_000, began_us)
