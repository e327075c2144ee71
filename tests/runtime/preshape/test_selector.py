"""A hand changes its preshape when the grasp type is sure and has been for a moment, and at no other time."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.preshape import Preshape, PreshapeError, PreshapeSelector, PreshapeTable
from thenar.runtime.published import UNKNOWN, Health, LiveGrasp

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
def test_what_is_held_is_the_newest_preshape_that_was_called_for_without_a_break(frames: list[LiveGrasp]) -> None:
    for number, answer in enumerate(answers(frames)):
        one = frames[number]
        told = one.health != "unknown" and TABLE.chosen.get(one.grasp) is not None
        assert answer is (held_after(frames[: number + 1]) if told else None)


@given(lives)
def test_nothing_is_ever_told_on_unknown(frames: list[LiveGrasp]) -> None:
    told = answers(frames, settle_ms=0)
    assert all(answer is None for one, answer in zip(frames, told, strict=True) if one.grasp == UNKNOWN)
    assert all(answer is None for one, answer in zip(frames, told, strict=True) if one.health == "unknown")


@given(lives)
def test_a_low_probability_never_changes_the_preshape(frames: list[LiveGrasp]) -> None:
    selector = PreshapeSelector(TABLE, min_probability=0.8, settle_ms=0)
    before: Preshape | None = None
    for one in frames:
        answer = selector.update(one)
        if one.probability < 0.8:
            assert answer in (None, before)
        before = answer or before


def test_grasp_types_that_share_a_preshape_settle_together() -> None:
    assert answers([frame(0, "PoS"), frame(20, "PoI"), frame(30, "PoS")]) == [None, None, WRAP]


def test_the_hand_stays_as_it_is_after_a_grasp_type_that_the_table_does_not_name() -> None:
    frames = [frame(0, "PoS"), frame(30, "PoS"), frame(40, "Lat"), frame(50, "PoS", 0.3)]
    assert answers(frames) == [None, WRAP, None, WRAP]


def test_a_break_begins_the_settling_anew() -> None:
    frames = [frame(0, "Tip"), frame(20, "Tip", 0.4), frame(30, "Tip"), frame(50, "Tip"), frame(60, "Tip")]
    assert answers(frames) == [None, None, None, None, PINCH]


@pytest.mark.parametrize("wrong", [{"min_probability": 1.5}, {"min_probability": float("nan")}, {"settle_ms": -1}])
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(PreshapeError):
        PreshapeSelector(TABLE, **wrong)
