from pathlib import Path

import pytest

from thenar.compiler.recordings.taxonomy import published
from thenar.simulator.body.shapes import Box, Cylinder, Sphere
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.scene_file import load_catalogue
from thenar.simulator.scenes.scene import SceneObject


def table(name: str, grasp: str, shape: str = 'shape = "sphere"\ndiameter_mm = 50') -> str:
    return f'[[objects]]\nname = "{name}"\ngrasp = "{grasp}"\nmass_g = 40\n{shape}\n'


# Line 1 is the taxonomy; each of the 14 objects takes 6 lines from line 2 on.
FULL = 'taxonomy = "kamakura14"\n' + "".join(table(f"for {g}", g) for g in published("kamakura14").types)


def load(tmp_path: Path, text: str) -> tuple[SceneObject, ...]:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return load_catalogue(path)[1]


def complaint(tmp_path: Path, text: str) -> str:
    with pytest.raises(SceneError) as caught:
        load(tmp_path, text)
    return str(caught.value)


@pytest.mark.parametrize("name", ["kamakura14", "cutkosky16"])
def test_a_shipped_catalogue_has_two_objects_for_every_type(name: str) -> None:
    taxonomy, objects = load_catalogue(name)
    grasps = [item.grasp for item in objects]
    assert taxonomy.name == name
    assert {grasp: grasps.count(grasp) for grasp in grasps} == dict.fromkeys(published(name).types, 2)
    assert len({item.name for item in objects}) == len(objects)


def test_the_three_shapes_are_read_with_their_sizes(tmp_path: Path) -> None:
    bar = 'shape = "cylinder"\ndiameter_mm = 20\nlength_mm = 90'
    card = 'shape = "box"\nlength_mm = 80\nwidth_mm = 50\nheight_mm = 4\nedge_mm = 1.5'
    objects = load(tmp_path, FULL + table("bar", "PoS", bar) + table("card", "Lat", card))
    assert objects[0].shape == Sphere(diameter_mm=50.0)
    assert objects[-2].shape == Cylinder(diameter_mm=20.0, length_mm=90.0)
    assert objects[-1].shape == Box(length_mm=80.0, width_mm=50.0, height_mm=4.0, edge_mm=1.5)
    assert (objects[-1].name, objects[-1].grasp, objects[-1].mass_g) == ("card", "Lat", 40.0)


def test_a_grasp_type_may_be_written_out_or_numbered(tmp_path: Path) -> None:
    more = table("a", "Power grip, hook type") + table("b", "12") + table("c", "tvii")
    assert [item.grasp for item in load(tmp_path, FULL + more)[-3:]] == ["PoH", "Tip", "TVII"]


def test_other_tables_of_a_catalogue_are_not_its_business(tmp_path: Path) -> None:
    assert load(tmp_path, FULL + "[types.PoS]\nanything = true\n") == load(tmp_path, FULL)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('grasp = "Tip"', 'grasp = "Tipp"', "line 70: objects[11].grasp: 'Tipp' is not a grasp type of kamakura14"),
        ("diameter_mm = 50", "diameter_mm = nan", "line 7: objects[0].diameter_mm: must be a finite number, not nan"),
        ("diameter_mm = 50", "diameter_mm = 300", "line 2: objects[0]: no hand holds an object of more than 200 mm"),
        ("diameter_mm = 50", "length_mm = 50", "line 7: objects[0].length_mm: this key is unknown"),
        (
            'shape = "sphere"',
            'shape = "spere"',
            "line 6: objects[0].shape: 'spere' is not a shape (did you mean 'sphere'",
        ),
        ('shape = "sphere"', "shape = [1]", "line 6: objects[0].shape: [1] is not a shape (there are: sphere, cyl"),
        (
            'shape = "sphere"',
            "",
            "line 2: objects[0].shape: the key shape is missing (there are: sphere, cylinder, box)",
        ),
        ('name = "for PoH"', 'name = "for PoS"', "line 9: objects[1].name: 'for PoS' is taken (line 2)"),
        ('name = "for PoH"', 'name = " "', "line 9: objects[1].name: ' ' begins or ends with a blank"),
        ('grasp = "Tip"', 'grasp = "PoS"', "line 2: objects: no object for Tip: every type of kamakura14 needs one"),
        ('"kamakura14"', '"kamakura"', "line 1: taxonomy: no taxonomy is called 'kamakura': take one of kamakura14"),
        (
            'shape = "sphere"\ndiameter_mm = 50',
            'shape = "cylinder"\ndiameter_mm = 4\nlength_mm = 9\nedge_mm = 3',
            "line 2: objects[0]: `edge_mm` 3.0 rounds off more",
        ),
    ],
)
def test_a_wrong_object_is_named_with_its_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert f"mine.toml, {message}" in complaint(tmp_path, FULL.replace(old, new, 1))


@pytest.mark.parametrize("objects", ["[]", "3", "'kamakura14'"])
def test_objects_that_are_no_tables_are_refused(tmp_path: Path, objects: str) -> None:
    assert "mine.toml, line 2: objects: must be " in complaint(
        tmp_path, f'taxonomy = "kamakura14"\nobjects = {objects}\n'
    )
