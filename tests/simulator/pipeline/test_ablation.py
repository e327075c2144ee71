import msgspec
import pytest

from thenar.compiler.evaluation.ablation import Ablation
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.evaluation.study import evaluate
from thenar.simulator import load_scene, simulate
from thenar.simulator.pipeline.ablation import ablate
from thenar.simulator.scenes.scene import ListedEffect, Scene

KEPT = ("hand.posture", "joint.noise")
# So much noise that it matters to joints, and to nothing else.
NOISE = ListedEffect("joint.noise", (("sd_deg", 40.0),))


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
    rows = {
        row.name: row
        for row in evaluate(made, jobs=1, repeats=1, tables=("compositions",), protocols=("paper",)).tables[0].rows
    }
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


def test_ablation_judges_only_the_frames_read_out() -> None:
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
    listed = msgspec.structs.replace(scene_of(4), effects=(ListedEffect("contact.quasistatic"),))
    assert [variant.without for variant in ablate(listed, jobs=1).variants] == [None]
