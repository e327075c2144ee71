"""What each shipped scene promises."""

import pytest
from msgspec.structs import replace

from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.steps import compile_pipeline
from thenar.simulator.planning.postures import Postures
from thenar.simulator.scenes import shipped
from thenar.simulator.scenes.scene import Scene, Subject

MEN = {"A": (188, 84), "B": (196, 89), "C": (181, 81), "D": (185, 83), "E": (192, 86), "F": (199, 91)}
FAULTS = {
    "switch.stuck_open",
    "switch.stuck_closed",
    "port.dead",
    "switch.bounce",
    "switch.ghosting",
    "joint.drift",
    "wire.lost_bytes",
    "wire.damaged_bytes",
}
PADS = {"taxel.gain", "taxel.creep", "taxel.crosstalk", "taxel.noise", "taxel.adc"}
IN_TIME = {"hand.transition", "contact.ramp", "frame.jitter", "bus.latency"}

ONSET = {*PADS, "contact.ramp", "frame.at_force"}
ADDED = {"quick": set(), "faulty-glove": FAULTS, "continuous": IN_TIME, "kamakura-analog": PADS}
ADDED["initial-contact"] = ONSET
ADDED |= {"continuous-def": IN_TIME, "continuous-rest": IN_TIME}


def effects(scene: Scene) -> dict[str, tuple]:
    return dict(scene.effects)


def sizes(scene: Scene) -> dict[str, tuple[float, float]]:
    return {subject.name: (subject.hand_length_mm, subject.hand_breadth_mm) for subject in scene.subjects}


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_scene_says_that_it_is_simulated_and_can_be_compiled(name: str) -> None:
    assert shipped()[name].read_text().startswith("# Simulated. ")
    scene = load_scene(name)
    assert scene.name == name
    assert compile_pipeline(scene).steps


@pytest.mark.parametrize("name", shipped())
def test_shipped_scenes_have_planned_postures_for_all_hands(name: str) -> None:
    scene = load_scene(name)
    postures = Postures.shipped(scene.taxonomy)
    for subject in (min(scene.subjects, key=length), max(scene.subjects, key=length)):
        for item in scene.objects:
            assert postures.held(subject.hand(), item.grasp, item.thing()).pads


def length(subject: Subject) -> float:
    return subject.hand_length_mm


@pytest.mark.parametrize(("name", "taxonomy"), [("kamakura", "kamakura14"), ("cutkosky", "cutkosky16")])
def test_paper_scenes_have_its_size_check_scenes_differ_in_people(name: str, taxonomy: str) -> None:
    scene, check = load_scene(name), load_scene(f"{name}-def")
    assert (scene.taxonomy, scene.repetitions) == (taxonomy, 100)
    assert sizes(scene) == {subject: MEN[subject] for subject in "ABC"}
    assert sizes(check) == {subject: MEN[subject] for subject in "DEF"}
    assert check.seed != scene.seed
    assert replace(check, name=scene.name, seed=scene.seed, subjects=scene.subjects) == scene


@pytest.mark.parametrize("name", shipped())
def test_what_varies_varies_alike_in_all_shipped_scenes(name: str) -> None:
    usual = effects(load_scene("kamakura"))
    assert {effect: effects(load_scene(name))[effect] for effect in usual} == usual


@pytest.mark.parametrize(("name", "added"), ADDED.items())
def test_a_scene_lists_what_it_is_for_and_nothing_else(name: str, added: set[str]) -> None:
    assert effects(load_scene(name)).keys() - effects(load_scene("kamakura")).keys() == added


def test_the_quick_scene_is_small() -> None:
    scene = load_scene("quick")
    assert (len(scene.subjects), scene.repetitions) == (2, 12)


def test_the_continuous_scene_keeps_every_frame_of_the_movement() -> None:
    recording = load_scene("continuous").recording
    assert (recording.rows, recording.rate_hz) == ("all", 100.0)
    assert recording.lead_ms > 0.0
    assert recording.release_ms > 0.0
    assert not recording.rest


def test_the_other_continuous_scenes_differ_in_people_or_in_rests_alone() -> None:
    scene, check, rested = (load_scene(f"continuous{each}") for each in ("", "-def", "-rest"))
    assert sizes(check) == {subject: MEN[subject] for subject in "DEF"}
    assert replace(check, name=scene.name, seed=scene.seed, subjects=scene.subjects) == scene
    recording = replace(scene.recording, rest=True, rest_ms=500.0)
    assert rested == replace(scene, name="continuous-rest", recording=recording)


def test_the_crowd_is_200_hands_of_both_sexes() -> None:
    scene = load_scene("crowd")
    assert (len(scene.subjects), scene.repetitions) == (200, 20)
    assert len(set(sizes(scene).values())) > 190
