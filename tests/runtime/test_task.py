"""A hand in a task: steps, detours, what is skipped, unexpected or held too long."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.errors import SettingError
from thenar.runtime.published import LiveGrasp, State
from thenar.runtime.task import Progress, Task, TaskFollower, TaskStep, begun, load_task

TYPES = ("a", "b", "c", "d")


def task_of(types: str, also: dict[int, tuple[str, ...]] | None = None) -> Task:
    """Return a task of these types; after step n may follow also[n] besides, before the first also[0]."""
    then = [((types[at],) if at < len(types) else ()) + (also or {}).get(at, ()) for at in range(len(types) + 1)]
    common: dict[str, Any] = {"shown": 1, "preshape": None, "joints": {}}
    common |= {"median_s": 1.0, "spread_s": 0.1, "limit_s": 2.0}
    steps = tuple(TaskStep(grasp=each, then=then[at], **common) for at, each in enumerate(types, 1))
    return Task(name="t", build="", demonstrations=("x",), preshapes=None, units={}, first=then[0], steps=steps)


def moment(time_us: int, state: State, segment: int, grasp: str, since_us: int | None) -> LiveGrasp:
    return LiveGrasp(
        time_us, 0, 0, grasp, grasp, 1.0, 0, "ok", 0, 0, 0,
        state=state, segment=segment, segment_type=grasp, segment_us=since_us,
    )  # fmt: skip


def played(task: Task, types: str, held_us: int = 500_000) -> list[Progress]:
    """Return the news when these types are grasped one after another, with nothing held in between."""
    follower, news, now = TaskFollower(task), list[Progress | None](), 0
    first = follower.update(moment(0, "none", 0, "none", None))
    assert first is not None
    assert (first.step, first.grasp, first.expected) == (0, "none", task.first)
    for number, grasp in enumerate(types, 1):
        begin = now
        states: list[tuple[State, int]] = [("forming", 10_000), ("held", held_us), ("held", 1), ("releasing", 9_000)]
        for state, lasts_us in states:
            now += lasts_us
            news.append(follower.update(moment(now, state, number, grasp, begin)))
        now += 300_000
        news.append(follower.update(moment(now, "none", number, "none", None)))
    return [each for each in news if each is not None]


@given(st.text("abcd", min_size=1, max_size=8))
def test_whoever_does_the_steps_gets_to_the_end_without_a_deviation(types: str) -> None:
    news = played(task_of(types), types)
    assert not any(each.deviation for each in news)
    assert [each.step for each in news if each.grasp != "none"] == list(range(1, len(types) + 1))
    assert [each.grasp for each in news if each.grasp != "none"] == list(types)
    assert [each.done for each in news] == [False] * (len(news) - 1) + [True]
    assert news[-1].expected == ()
    assert news[-1].text == "task is done"


@given(st.text("abcd", min_size=1, max_size=6), st.text("abcd", max_size=8))
def test_steps_never_go_back_and_what_deviates_is_said(types: str, done: str) -> None:
    task, step = task_of(types), 0
    for grasp in done:
        found = begun(task, step, grasp)
        left = types[step:]
        again = step > 0 and types[step - 1] == grasp
        if left[:1] == grasp:
            assert (found.step, found.deviation) == (step + 1, "")
        elif again:
            assert (found.step, found.deviation) == (step, "")
        elif grasp in left:
            assert (found.step, found.deviation) == (step + 1 + left.index(grasp), "skipped")
            assert found.detail == f"skipped: {', '.join(left[: left.index(grasp)])}"
        else:
            assert (found.step, found.deviation) == (step, "unexpected")
        assert found.grasp == grasp
        step = found.step


def test_a_demonstrated_successor_is_a_detour_not_a_deviation() -> None:
    task = task_of("ab", {1: ("c",)})
    assert (begun(task, 1, "c").step, begun(task, 1, "c").deviation) == (1, "")
    assert begun(task, 1, "c").text == "step 1 of 2, c held; next b (or c)"
    assert begun(task, 1, "d").detail == "d is unexpected: b or c was expected"
    assert begun(task, 2, "d").detail == "d is unexpected: the task was over"
    assert begun(task, 0, "c").text == "step 0 of 2, c held; next a. c is unexpected: a was expected"


def test_what_is_held_beyond_its_limit_is_too_long_once() -> None:
    news = played(task_of("ab"), "ab", held_us=2_100_000)
    assert [(each.step, each.grasp, each.deviation) for each in news] == [
        (1, "a", ""),
        (1, "a", "too long"),
        (1, "none", "too long"),
        (2, "b", ""),
        (2, "b", "too long"),
        (2, "none", "too long"),
    ]
    assert news[1].detail == "a is held for longer than 2 s"
    assert news[-1].done


@pytest.mark.parametrize(
    "content", [b"", b"{}", b"\xff", b'{"schema":2}', b'{"schema":1,"name":"t","build":"","demonstrations":[]}']
)
def test_what_is_no_task_is_refused_by_name(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "task.json").write_bytes(content)
    with pytest.raises(SettingError, match=r"task\.json is not a task of `thenar teach`"):
        load_task(tmp_path / "task.json")


def test_a_build_that_lacks_a_type_of_the_steps_is_refused() -> None:
    task_of("ab").check(("b", "a", "none"))
    with pytest.raises(SettingError, match="the build does not recognise b"):
        task_of("abb").check(("a", "none"))
