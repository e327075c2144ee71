import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.cli.ablation import Ablation, ablate, change_of
from thenar.compiler.evaluation.errors import EvaluationError
from thenar.compiler.evaluation.study import Options, evaluate
from thenar.simulator import load_scene, simulate
from thenar.simulator.effects.contact_quasistatic import Parameters
from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.scenes.scene import Listed, Scene

KEPT = ("hand.posture", "joint.noise")
# So much noise that it matters to joints, and to nothing else.
NOISE = Listed("joint.noise", EFFECTS["joint.noise"].parameters(sd_deg=40.0))


def scene_of(repetitions: int, subjects: int = 1) -> Scene:
    scene = load_scene("quick")
    return msgspec.structs.replace(
        scene,
        repetitions=repetitions,
        subjects=scene.subjects[:subjects],
        objects=tuple(item for item in scene.objects if item.grasp in ("Tpd", "TVI")),
        effects=(*tuple(each for each in scene.effects if each.name == KEPT[0]), NOISE),
    )


@pytest.fixture(scope="module")
def ablation() -> Ablation:
    return ablate(scene_of(8, subjects=2), jobs=1)


@pytest.mark.slow
def test_every_effect_is_removed_in_turn_from_the_whole_scene(ablation: Ablation) -> None:
    assert [variant.without for variant in ablation.variants] == [None, *KEPT]
    assert ablation.simulated
    for variant in ablation.variants:
        assert [one.inputs for one in variant.rates] == ["switches", "joints", "both"]
        assert variant.us_a_grasp > 0.0
        assert variant.rows + variant.unsettled == 32
        assert all((one.change is None) == (variant.without is None) for one in variant.rates)


@pytest.mark.slow
def test_rates_are_those_of_the_evaluation_with_all_switches(ablation: Ablation) -> None:
    made = simulate(scene_of(8, subjects=2), jobs=1).grasp_set
    options = Options(repeats=1, tables=("compositions",), protocols=("paper",))
    rows = {row.name: row for row in evaluate(made, options, jobs=1).tables[0].rows}
    for one, name in zip(ablation.variants[0].rates, ("V", "IV", "I"), strict=True):
        assert one.rate.correct[0] == sum(cell.rate.correct[0] for cell in rows[name].cells)
        assert one.rate.total == len(made)


@pytest.mark.slow
def test_what_an_effect_does_not_touch_does_not_change(ablation: Ablation) -> None:
    without_noise = ablation.variants[2].rates[0]
    assert without_noise.rate == ablation.variants[0].rates[0].rate
    assert without_noise.change is not None
    assert without_noise.change.mean == 0.0
    assert without_noise.change.low < 0.0 < without_noise.change.high


@pytest.mark.slow
def test_a_change_is_what_the_rate_of_the_same_inputs_gained(ablation: Ablation) -> None:
    whole, _, without_noise = ablation.variants
    assert without_noise.rates[1].rate.mean > whole.rates[1].rate.mean
    for one, before in zip(without_noise.rates, whole.rates, strict=True):
        assert one.change is not None
        assert one.change.mean == pytest.approx(one.rate.mean - before.rate.mean)


def test_a_scene_of_every_frame_is_judged_by_the_frames_that_are_read_out() -> None:
    scene = scene_of(4)
    every = msgspec.structs.replace(scene, recording=msgspec.structs.replace(scene.recording, rows="all"))
    found = ablate(msgspec.structs.replace(every, effects=()), jobs=1)
    assert [variant.rows + variant.unsettled for variant in found.variants] == [8]


@pytest.mark.slow
def test_progress_counts_fits_up_to_all_of_them() -> None:
    seen: list[tuple[int, int]] = []
    scene = scene_of(4)
    ablate(msgspec.structs.replace(scene, effects=scene.effects[:1]), 1, lambda done, total: seen.append((done, total)))
    assert seen == [(done, 24) for done in range(1, 25)]


def test_too_few_repetitions_to_cross_validate_are_refused_with_the_reason() -> None:
    with pytest.raises(EvaluationError, match="cannot be cut into 4 folds"):
        ablate(scene_of(1), jobs=1)


def test_the_contact_model_that_every_scene_needs_is_not_removed() -> None:
    listed = msgspec.structs.replace(scene_of(4), effects=(Listed("contact.quasistatic", Parameters()),))
    assert [variant.without for variant in ablate(listed, jobs=1).variants] == [None]


Outcomes = st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=300)


@given(Outcomes)
def test_a_change_lies_in_its_interval_and_that_within_what_is_possible(outcomes: list[tuple[bool, bool]]) -> None:
    now, before = np.array(outcomes, dtype=bool).T
    found = change_of(now, before)
    assert found.mean == pytest.approx(now.mean() - before.mean(), abs=1e-12)
    assert -1.0 <= found.low <= found.mean <= found.high <= 1.0
    opposite = change_of(before, now)
    assert (opposite.low, opposite.high) == pytest.approx((-found.high, -found.low))


def test_the_interval_is_the_one_of_agresti_and_min() -> None:
    # Their example (2005, table I; also Agresti, Categorical Data Analysis, 10.1): approval of a prime minister by 1600
    # people, asked twice: 794 and 570 kept their mind, 150 and 86 changed it.
    now = np.repeat([True, True, False, False], [794, 86, 150, 570])
    before = np.repeat([True, False, True, False], [794, 86, 150, 570])
    found = change_of(now, before)
    assert found.mean == pytest.approx(-0.04)
    assert (found.low, found.high) == pytest.approx((-0.0587, -0.0212), abs=2e-4)


def test_the_interval_covers_the_true_change_as_often_as_it_says() -> None:
    random = np.random.default_rng(11)
    covered = 0
    for _ in range(1000):
        before = random.random(60) < 0.9
        now = np.where(random.random(60) < 0.15, random.random(60) < 0.7, before)
        covered += (found := change_of(now, before)).low <= 0.15 * (0.7 - 0.9) <= found.high
    assert covered > 930
