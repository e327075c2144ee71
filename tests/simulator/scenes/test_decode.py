import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.pipeline.scene_file import load_catalogue, load_scene
from thenar.simulator.scenes.scene import Recording, Scene, SceneGlove, Subject, SurveyPopulation, draw_subjects

NAMES = tuple(EFFECTS)

LEAST = """\
seed = 1
taxonomy = "kamakura14"
objects = "kamakura14"
repetitions = 4
[[subjects]]
name = "A"
hand_length_mm = 188
hand_breadth_mm = 84
"""

ROOT = Path(__file__).resolve().parents[3]
Load = Callable[[str], Scene]


@pytest.fixture
def scene(tmp_path: Path) -> Load:
    """Return a function that loads the scene that a text is."""

    def of(text: str) -> Scene:
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return load_scene(path)

    return of


@pytest.fixture
def complaint(scene: Load) -> Callable[[str], str]:
    """Return a function that returns what is wrong with the scene that a text is."""

    def of(text: str) -> str:
        with pytest.raises(SceneError) as caught:
            scene(text)
        return str(caught.value)

    return of


def test_the_least_scene_has_defaults_for_everything_else(scene: Load) -> None:
    assert scene(LEAST) == Scene(
        name="mine",
        seed=1,
        taxonomy="kamakura14",
        objects=load_catalogue("kamakura14")[1],
        subjects=(Subject(name="A", hand_length_mm=188.0, hand_breadth_mm=84.0),),
        repetitions=4,
        recording=Recording(rate_hz=100.0, lead_ms=0.0, hold_ms=500.0, release_ms=0.0, rows="last"),
        glove=SceneGlove(layout="murakami160", threshold_n=1.0, codes="common"),
        effects=(),
    )


def test_everything_that_is_said_is_kept(scene: Load, tmp_path: Path) -> None:
    found = scene(
        'name = "other"\n'
        + LEAST
        + '[recording]\nrate_hz = 50\nlead_ms = 10\nhold_ms = 20\nrelease_ms = 30\nrows = "all"\n'
        + '[glove]\nthreshold_n = 0.8\ncodes = "raw"\n'
    )
    assert found.name == "other"
    assert found.recording == Recording(rate_hz=50.0, lead_ms=10.0, hold_ms=20.0, release_ms=30.0, rows="all")
    assert found.glove == SceneGlove(threshold_n=0.8, codes="raw")


def test_effects_come_by_their_rank_with_their_parameters(scene: Load) -> None:
    found = scene(LEAST + "[effects.joint.noise]\nsd_deg = 3\n[effects.hand.grip]\n[effects.joint.drift]\n").effects
    assert [name for name, _ in found] == ["hand.grip", "joint.noise", "joint.drift"]
    assert found[0].parameters == (("log_sd", 0.25),)
    assert found[1].parameters == (("sd_deg", 3.0), ("trial_sd_deg", 0.0))


def test_every_effect_may_be_listed_without_parameters(scene: Load) -> None:
    found = scene(LEAST + "".join(f"[effects.{name}]\n" for name in NAMES))
    assert [name for name, _ in found.effects] == sorted(NAMES, key=lambda name: EFFECTS[name].order)


def test_only_the_effects_that_are_listed_are_imported(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(LEAST + "[effects.joint.noise]\n[effects.switch.bounce]\n")
    program = (
        "import sys; from thenar.simulator.pipeline.scene_file import load_scene; load_scene(sys.argv[1]);"
        "print(*sorted(name for name in sys.modules if name.startswith('thenar.simulator.effects.')))"
    )
    done = subprocess.run([sys.executable, "-c", program, str(path)], check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["thenar.simulator.effects.joint_noise", "thenar.simulator.effects.switch_bounce"]


def test_a_population_is_drawn_with_the_seed_of_the_scene(scene: Load) -> None:
    text = LEAST[: LEAST.index("[[")] + '[population]\nsurvey = "ansur2"\ncount = 6\nwomen = 0.25\n'
    assert scene(text).subjects == draw_subjects(SurveyPopulation(survey="ansur2", count=6, women=0.25), seed=1)


def test_objects_of_ones_own_are_read_like_a_catalogue(scene: Load) -> None:
    data = ROOT / "simulator" / "planning" / "data" / "kamakura14.toml"
    objects = data.read_text()[data.read_text().index("[[objects]]") :]
    assert scene(LEAST.replace('objects = "kamakura14"', "") + objects).objects == load_catalogue("kamakura14")[1]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seed = 1", "seed = -1", "line 1: seed: must be at least 0, not -1"),
        ("repetitions = 4", "repetitions = 0", "line 4: repetitions: must be at least 1, not 0"),
        ('my = "kamakura14"', 'my = "feix"', "line 2: taxonomy: no taxonomy is called 'feix': take one of"),
        ('my = "kamakura14"', 'my = "cutkosky16"', "line 3: objects: catalogue 'kamakura14' is for taxonomy"),
        ('ts = "kamakura14"', 'ts = "kamakura"', "line 3: objects: no catalogue of objects is called 'kamakura'"),
        ('ts = "kamakura14"', "ts = 3", "line 3: objects: must be a list of tables, not 3"),
        ("length_mm = 188", "length_mm = inf", "line 7: subjects[0].hand_length_mm: must be a finite number, not inf"),
        ('name = "A"', 'name = "?"', "line 6: subjects[0].name: '?' means a missing value in every table"),
    ],
)
def test_a_wrong_key_is_named_with_its_line(complaint: Callable[[str], str], old: str, new: str, message: str) -> None:
    assert old in LEAST
    assert message in complaint(LEAST.replace(old, new, 1))
    assert complaint(LEAST.replace(old, new, 1)).startswith("mine.toml")


# Line 9 is the first of what is added.
@pytest.mark.parametrize(
    ("added", "message"),
    [
        ("[[subjects]]\nname='A'\nhand_length_mm=190\nhand_breadth_mm=85", "line 10: subjects[1].name: 'A' is taken"),
        ("[population]\nsurvey = 'ansur2'\ncount = 3", "line 9: population: and [[subjects]] are both there"),
        ("[glove]\nlayout = 'murakami16'", "line 10: glove.layout: 'murakami16' is not among its values (did you"),
        ("[recording]\nrows = 'every'", "line 10: recording.rows: 'every' is not among its values (there are: all"),
        ("[effects.joint.nois]", "line 9: effects.joint.nois: there is no effect 'joint.nois' (did you mean 'joint.n"),
        ("[effects.noise]\nsd_deg = 2", "line 9: effects.noise: there is no effect 'noise' (did you mean 'taxel.no"),
        ("[effects.joint]", "line 9: effects.joint: there is no effect 'joint'"),
        (
            '[effects."joint.noise"]',
            "line 9: effects.joint.noise: write the name without quotes: [effects.joint.noise]",
        ),
        ("[effects]\njoint = 3", "line 10: effects.joint: must be a table, not 3"),
        ("[effects.port.dead]\nports = [1]\ncount = 1", "line 9: effects.port.dead: give `ports` or `count`, not both"),
        ("[effects.port.dead]\nports = 1", "line 10: effects.port.dead.ports: must be a list, not 1"),
        ("[effects.hand.grip]\nafter = ['hand.style']", "line 10: effects.hand.grip.after: this key is unknown"),
    ],
)
def test_a_wrong_table_is_named_with_its_line(complaint: Callable[[str], str], added: str, message: str) -> None:
    assert f"mine.toml, {message}" in complaint(LEAST + added + "\n")


def test_nobody_to_simulate_is_an_error(complaint: Callable[[str], str]) -> None:
    assert "population: is missing, and there are no [[subjects]]" in complaint(LEAST[: LEAST.index("[[")])
    assert "subjects: must be a list of tables, not an empty list" in complaint(
        LEAST[: LEAST.index("[[")] + "subjects = []"
    )


def test_a_grasp_type_without_an_object_is_named(complaint: Callable[[str], str]) -> None:
    ball = "[[objects]]\nname = 'ball'\ngrasp = 'CMF'\nshape = 'sphere'\ndiameter_mm = 60\nmass_g = 50\n"
    message = complaint(LEAST.replace('objects = "kamakura14"', "") + ball)
    assert "mine.toml, line 9: objects: no object for PoS, PoH, PoI, PoE, PoD and 8 more" in message


def test_a_missing_file_is_told_the_names_of_the_shipped_scenes(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"there is no file .*quick\.toml; shipped scenes have the names .*quick"):
        load_scene(tmp_path / "quick.toml")
