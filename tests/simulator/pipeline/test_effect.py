"""When frames are scanned: always at the end of holding, whatever else; and the registry of effects."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator import effects
from thenar.simulator.pipeline.effect import EFFECTS, at_a_time, drawn_rows, frame_times, hold_frame

from ..small import make_setting

PERIODS = st.integers(1_000, 30_000)
TIMES = st.integers(0, 200_000)


def test_without_time_only_the_read_frame_exists() -> None:
    setting = make_setting(timed=False)
    assert frame_times(setting).tolist() == [setting.hold_us]
    assert hold_frame(setting) == 0
    assert drawn_rows(setting).tolist() == [0]


@given(period=PERIODS, lead=TIMES, hold=TIMES, release=TIMES)
def test_frames_are_a_period_apart_and_one_ends_holding(period: int, lead: int, hold: int, release: int) -> None:
    setting = make_setting(timed=True, period_us=period, first_us=-lead, hold_us=hold, release_us=release)
    times = frame_times(setting)
    assert times[hold_frame(setting)] == hold
    assert set(np.diff(times).tolist()) <= {period}
    assert -lead <= times[0] < -lead + period
    assert hold + release - period < times[-1] <= hold + release


@given(period=PERIODS, lead=TIMES, hold=TIMES, release=TIMES)
def test_frames_draw_separate_rows_the_read_one_first(period: int, lead: int, hold: int, release: int) -> None:
    setting = make_setting(timed=True, period_us=period, first_us=-lead, hold_us=hold, release_us=release)
    rows = drawn_rows(setting)
    assert sorted(rows.tolist()) == list(range(len(frame_times(setting))))
    assert rows[hold_frame(setting)] == 0


@given(period=PERIODS, hold=st.integers(1, 60_000_000), few=st.integers(1, 1000), more=st.integers(0, 1000))
def test_the_more_frames_the_fewer_repetitions_at_a_time_but_never_none(
    period: int, hold: int, few: int, more: int
) -> None:
    setting = make_setting(timed=True, period_us=period, hold_us=hold)
    frames = len(frame_times(setting))
    found = at_a_time(setting, few)
    assert 1 <= found <= few
    assert found == 1 or found * frames <= 50_000
    # None is left out for whom there is room.
    assert found == few or (found + 1) * frames > 50_000
    assert found <= at_a_time(setting, few + more)
    assert at_a_time(make_setting(timed=False, period_us=period, hold_us=hold), few) == few


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effects_record_has_default_parameters_and_one_factory(name: str) -> None:
    effect = EFFECTS[name]
    assert effect.name == name
    assert sum(maker is not None for maker in (effect.prepare, effect.model, effect.together)) == 1
    # A scene may list it without saying more.
    effect.parameters()()


def test_effect_modules_have_their_effects_name_and_unique_order() -> None:
    modules = {path.stem for path in Path(effects.__path__[0]).glob("*.py")} - {"__init__"}
    assert modules == {name.replace(".", "_") for name in EFFECTS}
    assert len({effect.order for effect in EFFECTS.values()}) == len(EFFECTS)
