"""A scene's postures: what is planned and what is not, in which order, and what is said of what cannot be."""

from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.optimize import least_squares

from thenar.simulator.body.condition import Thing
from thenar.simulator.body.hand import LIMITS_DEG
from thenar.simulator.body.shapes import Shape, Sphere, rotation
from thenar.simulator.errors import PlanError, SceneError
from thenar.simulator.planning.plan import Work, average_hand, plan_object, plan_scene, shipped_prehensions
from thenar.simulator.planning.planner import Misfit, _start_near
from thenar.simulator.planning.postures import Entry, Postures
from thenar.simulator.scenes.decode import load_scene
from thenar.simulator.scenes.scene import Scene, SceneObject, Subject

MakeScene = Callable[..., Scene]
SHIPPED = Postures.shipped("kamakura14")


def thing(name: str, grasp: str, shape: Shape) -> SceneObject:
    return SceneObject(name=name, grasp=grasp, shape=shape, mass_g=5.0)


def hand(length_mm: float) -> Subject:
    return Subject(name=f"{length_mm}", hand_length_mm=length_mm, hand_breadth_mm=80.0)


def figures(entry: Entry) -> np.ndarray:
    """Return postures and poses, turns as matrices: half a turn is the same either way round."""
    return np.array(
        [
            [*held.posture_deg, *held.pose[:3], *rotation(np.array(held.pose[3:])[:, None]).ravel()]
            for held in entry.held
        ]
    )


PEA, BEAN = thing("pea", "Tip", Sphere(7.5)), thing("bean", "Tip", Sphere(11.5))
BALL, MELON, MOON = (thing(name, "CMF", Sphere(size)) for name, size in (("ball", 64), ("melon", 199), ("moon", 200)))
BEAD = next(item for item in load_scene("kamakura").objects if item.name == "bead")


@pytest.mark.parametrize("name", ["kamakura", "cutkosky"])
def test_every_object_of_a_shipped_catalogue_is_planned_in_its_order_and_nothing_else_is(name: str) -> None:
    scene = load_scene(name)
    shipped = Postures.shipped(scene.taxonomy)
    assert [(entry.grasp, entry.shape) for entry in shipped.entries] == [(o.grasp, o.shape) for o in scene.objects]
    postures, planned = plan_scene(scene, jobs=1)
    assert planned == []
    assert postures.entries == shipped.entries


# Other processors round otherwise: what follows is the same grasp, and nearly the same numbers.
ROUNDING = 0.05
# The same of where the misfit is least, which is known better.
BOTTOM = 0.01


def bottom(misfit: Misfit, start: np.ndarray) -> np.ndarray:
    """Return where the misfit is least, downhill of a candidate (26,), as near as double precision comes to it."""

    def residuals(x: np.ndarray) -> np.ndarray:
        return misfit.residuals(x[:, None])[:, 0]

    low, high = np.radians(LIMITS_DEG.T)
    free = np.full(6, np.inf)
    found = least_squares(
        residuals,
        np.clip(start, [*(low + 1e-6), *-free], [*(high - 1e-6), *free]),
        jac="3-point",
        bounds=([*low, *-free], [*high, *free]),
        x_scale=np.repeat([0.2, 5.0, 0.2], [20, 3, 3]),
        max_nfev=2000,
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    assert found.success, found.message
    return np.asarray(found.x)


def cost(misfit: Misfit, candidate: np.ndarray) -> float:
    return float((misfit.residuals(candidate[:, None]) ** 2).sum()) / 2


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return how far apart two candidates (26,) are in degrees of a joint, mm and radians of the object's pose."""
    return float(np.abs((one - other) * np.repeat([np.degrees(1.0), 1.0, 1.0], [20, 3, 3])).max())


def check_on_the_same_way_down(entry: Entry, known: Entry, taxonomy: str, length_mm: float) -> None:
    """Hold today's posture of one hand length against the shipped one where they are ROUNDING apart.

    A descent ends where a step takes less than a millionth off its cost F, and a degree off the bottom costs at least
    1/2 (1/20)^2: so far before the bottom it may end, which for F = 28 is 0.15 degrees, and where exactly, the last
    digits of the machine's BLAS decide. Both must be no further apart, all but there, and on their way to one bottom.
    """
    hand, thing = average_hand(length_mm), Thing(known.object, known.shape, 1.0)
    misfit = Misfit(hand, shipped_prehensions(taxonomy)[known.grasp], known.shape)
    held = [Postures(taxonomy, (one,)).held(hand, known.grasp, thing) for one in (entry, known)]
    today, shipped = (_start_near(misfit, one) for one in held)
    lowest = bottom(misfit, shipped)
    least = cost(misfit, lowest)
    assert apart(today, shipped) < min(0.15, 20.0 * np.sqrt(2e-6 * least))
    assert max(cost(misfit, today), cost(misfit, shipped)) < 1.0001 * least
    assert apart(bottom(misfit, today), lowest) < BOTTOM


def test_the_shipped_posture_of_a_bead_is_what_is_planned_today() -> None:
    work = Work("Tip", shipped_prehensions("kamakura14")["Tip"], BEAD.thing(), 180.0, 210.0)
    known = SHIPPED.entry("Tip", BEAD.thing())
    assert known is not None
    assert np.abs(figures(plan_object(work).entry) - figures(known)).max() < ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kamakura", "cutkosky"])
def test_the_shipped_postures_are_what_is_planned_today(name: str) -> None:
    scene = load_scene(name)
    postures, planned = plan_scene(scene, anew=True)
    assert len(planned) == len(scene.objects)
    for entry, known in zip(postures.entries, Postures.shipped(scene.taxonomy).entries, strict=True):
        assert (entry.grasp, entry.object, entry.spheres) == (known.grasp, known.object, known.spheres)
        off = np.abs(figures(entry) - figures(known)).max(axis=1)
        for held in (held for held, most in zip(entry.held, off, strict=True) if most >= ROUNDING):
            check_on_the_same_way_down(entry, known, scene.taxonomy, held.length_mm)


def test_only_what_has_no_posture_is_planned(make_scene: MakeScene) -> None:
    reports: list[tuple[int, int]] = []
    postures, planned = plan_scene(make_scene(objects=(PEA, BEAD)), 1, lambda *report: reports.append(report))
    assert [one.entry.object for one in planned] == ["pea"]
    assert reports == [(1, 1)]
    assert [entry.object for entry in postures.entries[:2]] == ["pea", "bead"]
    assert set(postures.entries) == {*SHIPPED.entries, planned[0].entry}


def test_anew_all_of_the_scene_is_planned_and_nothing_else_kept(make_scene: MakeScene) -> None:
    postures, planned = plan_scene(make_scene(objects=(BEAD,)), 1, anew=True)
    assert postures.entries == tuple(one.entry for one in planned)
    assert [entry.object for entry in postures.entries] == ["bead"]


def test_a_changed_shape_is_planned_though_its_name_is_known(make_scene: MakeScene) -> None:
    larger = thing("bead", "Tip", msgspec.structs.replace(BEAD.shape, diameter_mm=13.0))
    assert [one.entry.shape for one in plan_scene(make_scene(objects=(larger,)), 1)[1]] == [larger.shape]


def test_two_objects_of_one_shape_and_type_are_planned_once(make_scene: MakeScene) -> None:
    twin = msgspec.structs.replace(PEA, name="twin", mass_g=3.0)
    assert len(plan_scene(make_scene(objects=(PEA, twin)), 1)[1]) == 1


@pytest.mark.slow
def test_the_result_does_not_depend_on_the_number_of_jobs(make_scene: MakeScene, tmp_path: Path) -> None:
    scene = make_scene(objects=(PEA, BALL, BEAN))  # the ball is done first
    saved = []
    for jobs in (1, 2, 3):
        postures, planned = plan_scene(scene, jobs, anew=True)
        assert [one.entry.object for one in planned] == ["pea", "ball", "bean"]
        postures.save(tmp_path / "postures.json")
        saved.append((tmp_path / "postures.json").read_bytes())
    assert len(set(saved)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_the_first_object_that_cannot_be_held_is_told_and_the_others_named(make_scene: MakeScene, jobs: int) -> None:
    with pytest.raises(PlanError) as refusal:
        plan_scene(make_scene(objects=(PEA, MELON, BALL, MOON), subjects=(hand(160.0),)), jobs)
    assert str(refusal.value).startswith("a hand of 165 mm cannot hold 'melon' with grasp type 'CMF': ")
    assert str(refusal.value).endswith("; nor can these be held: 'moon' (CMF)")


def test_what_a_hand_of_the_scene_need_not_hold_is_no_error(make_scene: MakeScene) -> None:
    (planned,) = plan_scene(make_scene(objects=(MELON,), subjects=(hand(222.0),)), 1)[1]
    assert planned.entry.covers(222.0)
    assert not planned.entry.covers(160.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lengths", "first", "last"),
    [
        ([188.0], 150.0, 225.0),
        ([135.0, 188.0], 135.0, 225.0),
        ([238.0], 150.0, 240.0),
        ([130.0, 240.0], 120.0, 240.0),
        ([225.1], 150.0, 240.0),
    ],
)
def test_lengths_go_as_far_as_the_hands_of_the_scene(
    make_scene: MakeScene, lengths: list[float], first: float, last: float
) -> None:
    hands = tuple(map(hand, lengths))
    postures, (planned,) = plan_scene(make_scene(objects=(PEA,), subjects=hands), 1)
    assert [held.length_mm for held in planned.entry.held] == np.arange(first, last + 1.0, 15.0).tolist()
    for subject in hands:
        assert postures.held(subject.hand(), "Tip", PEA.thing()).pads


def test_a_known_object_is_planned_again_for_a_hand_beyond_its_lengths_and_not_within(make_scene: MakeScene) -> None:
    far = make_scene(objects=(BEAD,), subjects=(hand(188.0), hand(238.0)))
    postures, (planned,) = plan_scene(far, 1)
    assert planned.entry.held[-1].length_mm == 240.0
    assert postures.entry("Tip", BEAD.thing()) == planned.entry
    known = SHIPPED.entry("Tip", BEAD.thing())
    assert known is not None
    assert np.abs(figures(planned.entry)[:-1] - figures(known)).max() < ROUNDING


def test_postures_of_ones_own_are_kept_where_they_cover_the_scenes_hands(make_scene: MakeScene, tmp_path: Path) -> None:
    known = SHIPPED.entry("Tip", BEAD.thing())
    assert known is not None
    short = msgspec.structs.replace(known, grip_n=9.0, held=known.held[2:4])
    Postures("kamakura14", (short,)).save(tmp_path / "own.json")
    own = {"objects": (BEAD,), "postures": tmp_path / "own.json"}
    postures, planned = plan_scene(make_scene(subjects=(hand(188.0),), **own), 1)
    assert (postures.entries[0], planned) == (short, [])
    assert len(plan_scene(make_scene(subjects=(hand(196.0),), **own), 1)[1]) == 1


def test_a_scene_may_name_the_file_that_is_only_to_be_written(make_scene: MakeScene, tmp_path: Path) -> None:
    path = tmp_path / "postures.json"
    scene = make_scene(objects=(PEA, BEAD), postures=path)
    postures, planned = plan_scene(scene, 1)
    assert len(planned) == 1
    postures.save(path)
    assert plan_scene(scene, 1)[1] == []
    path.write_text("{")
    with pytest.raises(SceneError, match="holds no planned postures"):
        plan_scene(scene, 1)


def test_a_taxonomy_without_a_table_cannot_be_planned(make_scene: MakeScene) -> None:
    item = thing("bead", "Tip Pinch", BEAD.shape)
    with pytest.raises(SceneError, match="no table of prehensions for the grasp types of 'feix33': nothing can be pla"):
        plan_scene(make_scene(taxonomy="feix33", objects=(item,)), 1)


def test_a_taxonomy_without_a_table_needs_none_where_everything_is_planned(
    make_scene: MakeScene, tmp_path: Path
) -> None:
    known = SHIPPED.entry("Tip", BEAD.thing())
    assert known is not None
    own = Postures("feix33", (msgspec.structs.replace(known, grasp="Tip Pinch"),))
    own.save(tmp_path / "own.json")
    item = thing("bead", "Tip Pinch", BEAD.shape)
    scene = make_scene(taxonomy="feix33", objects=(item,), postures=tmp_path / "own.json")
    assert plan_scene(scene, 1)[0].entries == own.entries


def test_a_type_that_its_taxonomys_table_lacks_is_named_with_its_object(make_scene: MakeScene) -> None:
    with pytest.raises(SceneError, match="kamakura14 has no prehension for grasp type 'Hold': 'pea' cannot"):
        plan_scene(make_scene(objects=(thing("pea", "Hold", PEA.shape),)), 1)


def test_an_interrupt_passes_through(make_scene: MakeScene) -> None:
    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan_scene(make_scene(objects=(PEA, BEAN)), 1, interrupt)
