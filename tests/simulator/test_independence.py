"""No effect disturbs another's random numbers, and a repetition made alone is the one of the full run.

What an effect draws is recorded word by word, with the counter that it was drawn at. Where one scene has many frames
and another a single one, effects that draw for every frame read on in the same numbers: the shorter begins the longer.
"""

from collections.abc import Iterable
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.pipeline.steps import Ledger, Pipeline, compile_pipeline
from thenar.simulator.streams import Draw

from .small import make_batch, make_scene

NAMES = tuple(EFFECTS)

# An effect and where it drew, (seed, repetition, condition, subject): the words.
Words = dict[tuple[str, tuple[int, ...]], bytes]

SILENT = {"frame.at_force", "taxel.hysteresis", "taxel.creep", "taxel.crosstalk", "taxel.adc"}
OTHERS = [name for name in NAMES if name != "contact.quasistatic"]
# Parameters with which everybody who can draw does, and the contact model is quick.
LIVELY: dict[str, dict[str, Any]] = {
    "bus.latency": {"jitter_us": 20.0},
    "port.dead": {"count": 2},
    "switch.stuck_open": {"count": 3},
    "switch.stuck_closed": {"count": 3},
    "wire.lost_bytes": {"rate": 0.01},
    "wire.damaged_bytes": {"rate": 0.01},
    "joint.noise": {"trial_sd_deg": 5.0},
    "contact.ramp": {"levels": 2},
    "contact.quasistatic": {"most_steps": 2},
}


def lively(names: Iterable[str]) -> list[tuple]:
    return [(name, LIVELY.get(name, {})) for name in names]


def record(names: Iterable[str], repetitions: Iterable[int] = (0, 3)) -> tuple[Pipeline, Words, Batch]:
    """Simulate effects on a batch; return the pipeline, all words drawn, and the batch."""
    pipeline, batch, words = compile_pipeline(make_scene(lively(names))), make_batch(repetitions), Words()
    plain = Draw._words

    def recorded(draw: Draw, repetitions: list[int], condition: int, subject: int, size: int) -> np.ndarray:
        drawn = plain(draw, repetitions, condition, subject, size)
        for repetition, row in zip(repetitions, drawn, strict=True):
            key = (draw.effect, (draw.seed, repetition, condition, subject))
            assert key not in words, f"{draw.effect} draws the same numbers twice"
            words[key] = row.tobytes()
        return drawn

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Draw, "_words", recorded)
        pipeline.run([batch], Ledger())
    return pipeline, words, batch


def of(effect: str, words: Words) -> Words:
    return {key: drawn for key, drawn in words.items() if key[0] == effect}


def assert_undisturbed(effect: str, one: tuple[Pipeline, Words, Batch], other: tuple[Pipeline, Words, Batch]) -> None:
    drawn, again = of(effect, one[1]), of(effect, other[1])
    assert drawn.keys() == again.keys()
    # Pads send frames of their own, of whose bytes effects of the wire draw as well.
    same_wire = one[0].setting.taxels == other[0].setting.taxels
    same_time = same_wire and one[0].setting.timed == other[0].setting.timed
    for key, words in drawn.items():
        few, many = sorted((words, again[key]), key=len)
        assert many.startswith(few), effect
        assert few == many or not same_time, effect


@pytest.fixture(scope="module")
def alone() -> dict[str, tuple[Pipeline, Words, Batch]]:
    """What every effect draws where it is the only one."""
    return {name: record([name]) for name in NAMES}


PAIRS = list(combinations(NAMES, 2))


def test_all_that_can_draw_do(alone: dict[str, tuple[Pipeline, Words, Batch]]) -> None:
    silent = {name for name in NAMES if not of(name, alone[name][1])}
    assert silent == {"contact.quasistatic", "contact.ramp", "hand.transition", "switch.ghosting", *SILENT}


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_adding_any_other_effect_leaves_its_draws_as_they_were(
    name: str, alone: dict[str, tuple[Pipeline, Words, Batch]]
) -> None:
    for pair in (pair for pair in PAIRS if pair[0] == name):
        both = record(pair)
        for effect in pair:
            assert_undisturbed(effect, alone[effect], both)


# What each repetition has for itself; some only where an effect makes it.
FIELDS = (
    *("posture_deg", "pose", "grip_n", "forces_n", "settled", "residual_n", "on_us", "off_us"),
    *("frame_us", "bits", "sensors_deg", "raw", "taxels", "lost"),
)
SUBSETS = st.sets(st.sampled_from(OTHERS)).map(lambda others: {"contact.quasistatic", *others})


@settings(max_examples=25, deadline=None)
@given(names=SUBSETS)
def test_in_any_company_it_draws_what_it_draws_alone(
    names: set[str], alone: dict[str, tuple[Pipeline, Words, Batch]]
) -> None:
    together = record(names)
    for effect in names:
        assert_undisturbed(effect, alone[effect], together)


@settings(max_examples=25, deadline=None)
@given(names=SUBSETS, repetitions=st.lists(st.integers(0, 99), min_size=2, max_size=4, unique=True))
def test_a_repetition_made_alone_is_the_one_of_the_full_run(names: set[str], repetitions: list[int]) -> None:
    _, words, batch = record(names, repetitions)
    for row, number in enumerate(repetitions):
        _, few, single = record(names, [number])
        assert few.items() <= words.items()
        for field in FIELDS:
            if getattr(batch, field) is not None:
                assert getattr(single, field)[0].tobytes() == getattr(batch, field)[row].tobytes(), field
