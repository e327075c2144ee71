import msgspec
import pytest

from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.explain import explain
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.steps import compile_pipeline

QUICK = load_scene("quick")


def test_steps_are_explained_in_the_order_in_which_they_run() -> None:
    found = explain(QUICK, jobs=1)
    stops = compile_pipeline(QUICK).steps
    for step, stop in zip(found.steps, stops, strict=True):
        effect = stop.effect
        assert (step.name, step.own) == (effect.name, stop.own)
        assert (step.reads, step.writes, step.timed, step.on_wire) == (
            effect.reads,
            effect.writes,
            effect.timed,
            effect.on_wire,
        )
    assert (found.timed, found.on_wire) == (False, False)


def test_what_to_expect_follows_from_a_few_grasps_of_several_conditions() -> None:
    found = explain(QUICK, jobs=1)
    # Two subjects, 14 types with two objects each: six repetitions a condition.
    assert found.repetitions == 2 * 14 * 12
    assert (found.conditions, found.measured) == (28, 6 * 28)
    assert found.us_a_grasp == pytest.approx(sum(step.us_a_grasp for step in found.steps))
    assert found.expected_s == pytest.approx(found.us_a_grasp * found.repetitions / 1e6)
    assert sum(step.share for step in found.steps) == pytest.approx(1.0)


def test_more_processes_are_expected_to_be_faster() -> None:
    found = explain(QUICK, jobs=2)
    assert found.workers == 2
    assert found.expected_s == pytest.approx(found.us_a_grasp * found.repetitions / 2 / 1e6)


def test_draws_are_counted_a_grasp() -> None:
    drawn = {step.name: step.draws_a_grasp for step in explain(QUICK, jobs=1).steps}
    assert (drawn["hand.grip"], drawn["hand.posture"], drawn["glove.sample"]) == (1.0, 20.0, 0.0)


def test_a_scene_with_an_unholdable_object_cannot_be_explained() -> None:
    (bead,) = (item for item in QUICK.objects if item.name == "bead")
    large = msgspec.structs.replace(bead, shape=msgspec.structs.replace(bead.shape, diameter_mm=190.0))
    with pytest.raises(SceneError, match="cannot hold 'bead' with grasp type 'Tip'"):
        explain(msgspec.structs.replace(QUICK, objects=(large,)))
