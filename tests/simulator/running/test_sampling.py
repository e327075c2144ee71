import msgspec
import pytest

from thenar.simulator.errors import SceneError
from thenar.simulator.running.explain import best_us, middle_session, sample
from thenar.simulator.scenes.decode import load_scene

QUICK = load_scene("quick")
MIDDLE = middle_session(QUICK)


def test_samples_are_the_first_repetitions_of_all_conditions_of_one_session() -> None:
    found = sample(MIDDLE, 84)
    assert [batch.condition for batch in found] == list(MIDDLE.conditions)
    assert {batch.condition.subject for batch in found} == {QUICK.subjects[1].name}
    assert all(batch.repetitions.tolist() == [0, 1, 2] for batch in found)


@pytest.mark.parametrize(("most", "size"), [(1, 1), (56, 2), (100_000, 6)])
def test_a_sample_has_about_as_many_repetitions_as_asked_for(most: int, size: int) -> None:
    assert [len(batch) for batch in sample(MIDDLE, most)] == [size] * 28


def test_every_variant_has_a_time() -> None:
    scene = msgspec.structs.replace(QUICK, repetitions=2)
    times = best_us(scene, [None, "hand.grip"])
    assert len(times) == 2
    assert min(times) > 0.0


def test_what_the_scene_does_not_list_cannot_be_left_out() -> None:
    with pytest.raises(SceneError, match=r"port\.dead"):
        best_us(QUICK, ["port.dead"])
