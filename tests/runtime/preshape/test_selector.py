"""A hand changes its preshape when the grasp type is sure and has been for a moment, and at no other time."""

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.drivers.errors import SettingError
from thenar.runtime import Build
from thenar.runtime.preshape import PreshapeSelector, PreshapeTable, preshape_selector
from thenar.runtime.published import NONE, UNKNOWN, Health, LiveGrasp, Preshape, State

WRAP = Preshape("wrap", ("a",), (0.0,), 1.0)
PINCH = Preshape("pinch", ("a",), (1.0,), 1.0)
TABLE = PreshapeTable("test", {"PoS": WRAP, "PoI": WRAP, "Tip": PINCH})
SETTLE_MS = 30
HEALTHS: tuple[Health, ...] = ("ok", "ok", "changing", "degraded", "unknown")


def frame(time_ms: float, grasp: str, probability: float = 0.95, health: Health = "ok") -> LiveGrasp:
    if grasp == UNKNOWN:
        probability = 0.0
    time_us = int(time_ms * 1000)
    return LiveGrasp(time_us, time_us, 0, grasp, grasp, probability, 10, health, 0, 0, 0)


def answers(frames: Sequence[LiveGrasp], settle_ms: float = SETTLE_MS) -> list[Preshape | None]:
    selector = PreshapeSelector(TABLE, min_probability=0.8, settle_ms=settle_ms)
    return [selector.update(one) for one in frames]


def called(one: LiveGrasp) -> Preshape | None:
    return TABLE.chosen.get(one.grasp) if one.probability >= 0.8 and one.health != "unknown" else None


def held_after(frames: Sequence[LiveGrasp]) -> Preshape | None:
    """The newest preshape that a run of frames without a break called for, over the settling time, counted anew."""
    for end in range(len(frames) - 1, -1, -1):
        start = end
        while start and called(frames[start - 1]) is called(frames[end]):
            start -= 1
        if called(frames[end]) and frames[end].time_us - frames[start].time_us >= SETTLE_MS * 1000:
            return called(frames[end])
    return None


def of_live(steps: list[tuple[int, str, float, Health]]) -> list[LiveGrasp]:
    time_ms, frames = 0, []
    for step_ms, grasp, probability, health in steps:
        time_ms += step_ms
        frames.append(frame(time_ms, grasp, probability, health))
    return frames


lives = st.lists(
    st.tuples(
        st.sampled_from((1, 10, 10, 20, 40)),
        st.sampled_from(("PoS", "PoS", "PoS", "PoI", "Tip", "Tip", "Lat", UNKNOWN)),
        st.sampled_from((0.5, 0.79, 0.8, 0.95, 0.95, 1.0)),
        st.sampled_from(HEALTHS),
    ),
    max_size=40,
).map(of_live)


@given(lives)
def test_the_preshape_is_the_newest_called_for_without_break(frames: list[LiveGrasp]) -> None:
    for number, answer in enumerate(answers(frames)):
        one = frames[number]
        told = one.health != "unknown" and TABLE.chosen.get(one.grasp) is not None
        assert answer is (held_after(frames[: number + 1]) if told else None)


@pytest.mark.parametrize("wrong", [{"min_probability": 1.5}, {"min_probability": float("nan")}, {"settle_ms": -1}])
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(SettingError):
        PreshapeSelector(TABLE, **wrong)


OPEN = Preshape("open", ("a",), (-1.0,), 1.0)
OPENING = PreshapeTable("test", {**TABLE.chosen, NONE: OPEN})
# A segment of a type forms for 50 ms, is held for 200 and released for 20; then nothing is held for 100.
Steps = list[tuple[State, str, int]]


def grasped(*types: str) -> Steps:
    """Return grasps of these types, each of which goes over into the next; nothing is held before and after."""
    held: Steps = [("none", NONE, 100)]
    for type_ in types:
        held += [("forming", type_, 50), ("held", type_, 200)]
    return [*held, ("releasing", types[-1], 20), ("none", NONE, 100)]


def moving(*parts: Steps, probability: float = 0.95, health: Health = "ok") -> list[LiveGrasp]:
    """Return frames 10 ms apart, whose `grasp` is always another type."""
    found = list[LiveGrasp]()
    for state, type_, lasts_ms in [step for part in parts for step in part]:
        sure = 0.0 if type_ == NONE else probability
        for _ in range(0, lasts_ms, 10):
            one = frame(10 * len(found), "Lat", health=health)
            found.append(replace(one, state=state, segment_type=type_, segment_probability=sure))
    return found


def changes(frames: list[LiveGrasp], table: PreshapeTable = TABLE, **how: bool) -> list[tuple[str, State]]:
    """Return the preshapes that were changed to, and in which states."""
    selector, found, before = PreshapeSelector(table, settle_ms=SETTLE_MS, segments=True, **how), [], None
    for one in frames:
        now = selector.update(one)
        if now is not None and now is not before:
            found.append((now.name, one.state))
            before = now
    return found


def test_a_forming_segment_calls_for_its_preshape() -> None:
    assert changes(moving(grasped("PoS"), grasped("Tip"), grasped("PoS"))) == [
        ("wrap", "forming"),
        ("pinch", "forming"),
        ("wrap", "forming"),
    ]


def test_what_is_held_is_let_go_of_before_the_preshape_changes() -> None:
    frames = moving(grasped("PoS", "Tip", "PoS", "Tip"), grasped("Tip"))
    assert changes(frames) == [("wrap", "forming"), ("pinch", "forming")]
    assert frames[-len(moving(grasped("Tip"))) :][0].state == "none"
    assert [name for name, _ in changes(frames, change_while_held=True)] == ["wrap", "pinch", "wrap", "pinch"]


def test_before_it_is_held_the_type_that_forms_may_turn_out_otherwise() -> None:
    steps: Steps = [("none", NONE, 50), ("forming", "Tip", 60), ("forming", "PoS", 60), ("held", "PoS", 100)]
    assert changes(moving(steps)) == [("pinch", "forming"), ("wrap", "forming")]


def test_a_type_held_too_briefly_delays_nothing() -> None:
    steps: Steps = [("none", NONE, 50), ("held", "Tip", 30), ("held", "PoS", 100)]
    assert changes(moving(steps)) == [("wrap", "held")]


def test_an_empty_hand_opens_where_the_table_says_how() -> None:
    frames = moving(grasped("PoS"), grasped("Tip"))
    assert changes(frames, OPENING) == [
        ("open", "none"),
        ("wrap", "forming"),
        ("open", "none"),
        ("pinch", "forming"),
        ("open", "none"),
    ]


def test_a_segment_that_is_not_sure_enough_or_unknown_changes_nothing() -> None:
    assert not changes(moving(grasped("PoS"), probability=0.79))
    assert not changes(moving(grasped("PoS"), health="unknown"))


@given(
    st.lists(
        st.tuples(
            st.sampled_from(("none", "forming", "held", "releasing")),
            st.sampled_from(("PoS", "Tip", "Lat")),
            st.sampled_from((10, 30, 40, 80)),
        ),
        max_size=20,
    )
)
def test_an_empty_hand_only_opens_and_grasps_change_once(steps: Steps) -> None:
    frames = moving([(state, NONE if state == "none" else type_, ms) for state, type_, ms in steps])
    assert not [state for _, state in changes(frames) if state == "none"]
    assert not [name for name, state in changes(frames, OPENING) if state == "none" and name != "open"]
    for is_none, part in groupby(frames, lambda one: one.state == "none"):
        states = [state for _, state in changes(list(part))]
        assert not is_none or not states
        # After the preshape of what is held was taken, nothing changes until it is let go of.
        assert states.count("held") <= 1
        assert "held" not in states[:-1]


@pytest.mark.parametrize(("last", "segments"), [(NONE, True), ("Tip", False)])
def test_segments_call_where_the_build_was_trained_with_rows_of_nothing_held(
    make_build: Callable[..., Build], last: str, segments: bool
) -> None:
    plain = make_build(classes=3)
    build = Build(replace(plain.manifest, grasps=("CMF", "PoS", last)), plain.tables)
    selector, lacking = preshape_selector("barrett_bh8", build)
    assert not lacking
    one = replace(frame(0, "CMF"), state="held", segment_type="PoS", segment_probability=1.0)
    told = [selector.update(replace(one, time_us=ms * 1000)) for ms in range(200)][-1]
    assert told is not None
    assert told.name == ("cylindrical" if segments else "spherical")


def test_a_table_need_not_name_none() -> None:
    assert not TABLE.check(("PoS", "Tip", NONE))
    assert not OPENING.check(("PoS", "Tip", NONE))
