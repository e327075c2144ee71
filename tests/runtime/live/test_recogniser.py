"""Random schedules of arrivals under a simulated clock, beside a slow recogniser that starts from the definitions."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.errors import SettingError
from thenar.runtime import Build, FrameError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.recogniser import LiveRecognizer
from thenar.runtime.policy import Policy
from thenar.runtime.published import UNKNOWN, LiveGrasp
from thenar.runtime.scores import Scorer

MakeBuild = Callable[..., Build]
Arrival = tuple[int, SwitchFrame | None, GloveFrame | None]

SWITCHES, JOINTS = 6, 3
SWITCH_PERIOD, GLOVE_PERIOD = 1000, 700
SENSORS = ("j2", "other", "j0", "j1")
GRACE = 2200
AT_ONCE = Policy(lead=0, dwell_us=0, hold_us=0, grace_us=GRACE)

masks = st.integers(0, (1 << SWITCHES) - 1)
delays = st.integers(0, 300)


def recognizer(build: Build, policy: Policy = AT_ONCE, sensor_names: tuple[str, ...] = SENSORS) -> LiveRecognizer:
    return LiveRecognizer(
        build,
        sensor_names=sensor_names,
        switch_period_us=SWITCH_PERIOD,
        glove_period_us=GLOVE_PERIOD,
        policy=policy,
    )


SWITCHED = st.none() | st.tuples(delays, masks, st.just(0) | masks)
WORN = st.none() | st.tuples(
    delays,
    st.binary(min_size=len(SENSORS), max_size=len(SENSORS)),
    st.sampled_from([None, 0x81, 0x80, 0x87, 0x86]),
)
LATER = st.sampled_from([0, 1, 300, 700, 1000, 1400, 1401, 2000, 2001, 5000])


@st.composite
def schedules(draw: st.DrawFn) -> list[Arrival]:
    """Times that never fall, and what came in by then: frames of up to 300 us ago, or nothing."""
    now, found = 10_000, []
    for _ in range(draw(st.integers(1, 25))):
        now += draw(LATER)
        switches, glove = draw(SWITCHED), draw(WORN)
        found.append(
            (
                now,
                switches and SwitchFrame(now - switches[0], *switches[1:]),
                glove and GloveFrame(now - glove[0], *glove[1:]),
            )
        )
    return found


def newest(frames: list[Any]) -> Any:
    """The newest of frames in the order of their arrival; of equal times the last."""
    found = None
    for frame in frames:
        if frame is not None and (found is None or frame.time_us >= found.time_us):
            found = frame
    return found


def flags(mask: int) -> np.ndarray:
    return np.array([mask >> bit & 1 for bit in range(SWITCHES)], bool)


def definition(build: Build, arrivals: list[Arrival]) -> dict[str, Any]:
    """What has to be said at the time of the last arrival."""
    now, tables = arrivals[-1][0], build.tables
    switches, glove = newest([arrival[1] for arrival in arrivals]), newest([arrival[2] for arrival in arrivals])
    no_switches = switches is None or now - switches.time_us > 2 * SWITCH_PERIOD
    no_glove = glove is None or now - glove.time_us > GRACE or (glove.status or 1) % 2 == 0
    late = not no_glove and now - glove.time_us > 2 * GLOVE_PERIOD
    lost = flags((1 << SWITCHES) - 1) if no_switches else flags(switches.lost)
    bits = flags(0) if no_switches else flags(switches.closed)
    codes = [0, 0, 0] if no_glove else [glove.sensors[SENSORS.index(f"j{number}")] for number in range(JOINTS)]
    absent = np.array([code == 0 for code in codes])  # a byte of 0 is a sensor that was not measured
    lanes = Scorer(tables).biased_scores(bits, codes, lost, absent)
    weights = [np.abs(row.astype(int)).sum() for row in tables.switch_rows]
    joints = np.array([np.ptp(rows.astype(int), axis=0).sum() for rows in tables.joint_rows])
    weight_lost = sum(np.array(weights)[lost]) + sum(joints[absent])
    unknown = bool(weight_lost > 0.5 * (sum(weights) + sum(joints))) or bool(lost.all() and absent.all())
    best = int(np.argmax(lanes))
    odds = np.exp((np.array(lanes) - max(lanes)) / tables.scale)
    names = [f"s{number}" for number in np.flatnonzero(lost)] + [f"j{number}" for number in np.flatnonzero(absent)]
    return {
        "grasp": UNKNOWN if unknown else build.grasps[best],
        "candidate": UNKNOWN if unknown else build.grasps[best],
        "probability": 0.0 if unknown else 1 / odds.sum(),
        "margin": 0 if unknown else int(np.diff(np.sort(lanes)[-2:])[0]),
        "health": "unknown" if unknown else "degraded" if names or late else "ok",
        "switch_age_us": None if switches is None else now - switches.time_us,
        "glove_age_us": None if glove is None else now - glove.time_us,
        "latency_us": min([now - frame.time_us for frame in (switches, glove) if frame is not None], default=0),
        "lost": tuple(names),
    }


@given(seed=st.integers(0, 20), schedule=schedules())
def test_every_answer_follows_from_the_newest_frames_and_their_ages_alone(
    make_build: MakeBuild, seed: int, schedule: list[Arrival]
) -> None:
    build = make_build(seed)
    live = recognizer(build)
    for number, (now, switches, glove) in enumerate(schedule):
        found = live.step(now, now + 7, switches, glove).grasp
        expected = definition(build, schedule[: number + 1])
        assert (found.time_us, found.unix_us, found.number) == (now, now + 7, number)
        assert math.isclose(found.probability, expected.pop("probability"), rel_tol=1e-9)
        assert {name: getattr(found, name) for name in expected} == expected


@pytest.mark.slow
@given(schedule=schedules(), again=st.integers(0, 3))
def test_frames_that_are_handed_over_again_grow_no_younger(
    make_build: MakeBuild, schedule: list[Arrival], again: int
) -> None:
    once, repeated = recognizer(make_build()), recognizer(make_build())
    last: list[Any] = [None, None]
    for now, switches, glove in schedule:
        last = [newest([last[0], switches]), newest([last[1], glove])]
        expected = once.step(now, 0, switches, glove).grasp
        for _ in range(again):
            repeated.step(now, 0, *last)
        found = repeated.step(now, 0, *last).grasp
        assert found == LiveGrasp(**{**as_dict(expected), "number": found.number})


def as_dict(grasp: LiveGrasp) -> dict[str, Any]:
    return {name: getattr(grasp, name) for name in grasp.__struct_fields__}


@pytest.mark.parametrize(("switches", "joints"), [(0, 3), (6, 0)])
def test_a_device_that_the_build_does_not_use_is_not_missed(make_build: MakeBuild, switches: int, joints: int) -> None:
    live = recognizer(make_build(switches=switches, joints=joints))
    if switches:
        found = live.step(0, 0, SwitchFrame(0, 3), None).grasp
    else:
        found = live.step(0, 0, None, GloveFrame(0, b"\x05\x06\x07\x08")).grasp
    assert (found.health, found.lost) == ("ok", ())


def test_a_glove_that_the_harness_does_not_have_is_lost_for_good(make_build: MakeBuild) -> None:
    live = LiveRecognizer(make_build(), switch_period_us=1000, policy=Policy(max_lost=1.0))
    found = live.step(0, 0, SwitchFrame(0, 3), GloveFrame(0, b"")).grasp
    assert (found.health, found.lost, found.glove_age_us) == ("degraded", ("j0", "j1", "j2"), None)


def test_what_does_not_fit_is_refused_with_our_own_errors(make_build: MakeBuild) -> None:
    with pytest.raises(FrameError):
        recognizer(make_build()).step(0, 0, None, GloveFrame(0, b"\x01"))
    with pytest.raises(FrameError):
        recognizer(make_build()).step(0, 0, SwitchFrame(0, 1 << SWITCHES), None)
    with pytest.raises(SettingError):
        recognizer(make_build(), sensor_names=("j0", "j1"))


def test_without_a_lag_there_are_no_segments(make_build: MakeBuild) -> None:
    live = recognizer(make_build(), Policy(lag_us=None))
    for now in range(0, 300_000, 1000):
        found = live.step(now, 0, SwitchFrame(now, 5), GloveFrame(now, b"\x05\x06\x07\x08")).grasp
        assert (found.state, found.segment, found.segment_us, found.segment_probability) == ("none", 0, None, 0.0)


def test_a_segment_has_the_probability_of_its_type_in_this_frame(make_build: MakeBuild) -> None:
    build, random = make_build(), np.random.default_rng(5)
    live, seen = recognizer(build, Policy(lag_us=30_000, quarantine=False)), 0
    for now in range(0, 600_000, 1000):
        closed, sensors = (int(random.integers(64)), bytes(random.integers(1, 256, 4, np.uint8)))
        found = live.step(now, 0, SwitchFrame(now, closed), GloveFrame(now, sensors)).grasp
        if found.segment_us is not None:
            codes = np.array([sensors[SENSORS.index(f"j{number}")] for number in range(JOINTS)], np.uint16)
            odds = np.exp((build.scores(flags(closed), codes) - 0.0) / build.tables.scale)
            expected = odds[build.grasps.index(found.segment_type)] / odds.sum()
            assert math.isclose(found.segment_probability, expected, rel_tol=1e-9)
            seen += found.segment_type != found.grasp
    assert seen


@pytest.mark.parametrize(
    ("period_us", "grace_us", "until_us"), [(10_000, None, 60_000), (30_000, None, 120_000), (10_000, 25_000, 25_000)]
)
def test_a_late_record_serves_degraded_until_the_grace_ends(
    make_build: MakeBuild, period_us: int, grace_us: int | None, until_us: int
) -> None:
    """Joints hold all the weight, so without them the answer is unknown. A late record displaces no answer."""
    build = make_build(joints=JOINTS, switches=0)
    live = LiveRecognizer(
        build, sensor_names=SENSORS, glove_period_us=period_us, policy=Policy(grace_us=grace_us, hold_us=500_000)
    )
    first = live.step(0, 0, None, GloveFrame(0, b"\x05\x06\x07\x08")).grasp
    assert first.health == "ok"
    for age_us, health in (
        (2 * period_us, "ok"),
        (2 * period_us + 1, "degraded"),
        (until_us, "degraded"),
        (until_us + 1, "unknown"),
    ):
        moment = live.step(age_us, 0, None, None)
        grasp = moment.grasp
        assert (grasp.health, grasp.glove_age_us) == (health, age_us)
        assert (grasp.grasp == UNKNOWN) is (health == "unknown")
        assert (moment.codes is None) is (health == "unknown")
        assert grasp.lost == (("j0", "j1", "j2") if health == "unknown" else ())
    back = live.step(until_us + 2, 0, None, GloveFrame(until_us + 2, b"\x05\x06\x07\x08")).grasp
    assert (back.health, back.grasp) == ("ok", first.grasp)


def test_after_unknown_the_first_candidate_is_decided_on_at_once(make_build: MakeBuild) -> None:
    live, record = recognizer(make_build(), Policy(dwell_us=10**6, hold_us=10**6)), b"\x05\x06\x07\x08"
    first = live.step(0, 0, SwitchFrame(0, 0), GloveFrame(0, record)).grasp
    other = next(
        closed
        for closed in range(1 << SWITCHES)
        if recognizer(make_build()).step(0, 0, SwitchFrame(0, closed), GloveFrame(0, record)).grasp.candidate
        != first.grasp
    )
    held = live.step(100, 0, SwitchFrame(100, other), GloveFrame(100, record)).grasp
    assert held.grasp == first.grasp != held.candidate
    assert live.step(90_000, 0, None, None).grasp.grasp == UNKNOWN
    found = live.step(9100, 0, SwitchFrame(9100, other), GloveFrame(9100, record)).grasp
    assert found.grasp == found.candidate == held.candidate
