"""A scene's postures: what is planned, what is kept for later, and what is said of what cannot be held."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.optimize import least_squares

from thenar.simulator.body.condition import Thing
from thenar.simulator.body.hand import LIMITS_DEG
from thenar.simulator.body.shapes import Shape, Sphere, rotation
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.planning.plan import (
    average_hand,
    lacking,
    planned,
    postures_of,
    shipped_prehensions,
)
from thenar.simulator.planning.planner import Misfit, _start_near
from thenar.simulator.planning.postures import Entry, Postures
from thenar.simulator.scenes.scene import SceneObject, Subject

from ..small import make_scene

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


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "thenar"


@pytest.mark.parametrize("name", ["kamakura", "cutkosky"])
def test_every_object_of_a_shipped_catalogue_has_shipped_postures_in_its_order(name: str, cache: Path) -> None:
    scene = load_scene(name)
    shipped = Postures.shipped(scene.taxonomy)
    assert [(entry.grasp, entry.shape) for entry in shipped.entries] == [(o.grasp, o.shape) for o in scene.objects]
    assert postures_of(scene, 1).entries == shipped.entries
    assert not cache.exists()


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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kamakura", "cutkosky"])
def test_the_shipped_postures_are_what_is_planned_today(name: str) -> None:
    scene = load_scene(name)
    works = list(lacking(scene, Postures(scene.taxonomy, ())))
    assert len(works) == len(scene.objects)
    for entry, known in zip(planned(works), Postures.shipped(scene.taxonomy).entries, strict=True):
        assert (entry.grasp, entry.object, entry.spheres) == (known.grasp, known.object, known.spheres)
        off = np.abs(figures(entry) - figures(known)).max(axis=1)
        for held in (held for held, most in zip(entry.held, off, strict=True) if most >= ROUNDING):
            check_on_the_same_way_down(entry, known, scene.taxonomy, held.length_mm)


def test_only_what_has_no_posture_is_planned_and_once(cache: Path) -> None:
    reports: list[tuple[int, int]] = []
    scene = make_scene(objects=(PEA, BEAD))
    postures = postures_of(scene, 1, lambda *report: reports.append(report))
    assert reports == [(1, 1)]
    pea = postures.entry("Tip", PEA.thing())
    assert set(postures.entries) == {*SHIPPED.entries, pea}
    (path,) = cache.iterdir()
    assert Postures.load(path).entries == (pea,)
    assert postures_of(scene, 1, lambda *_: pytest.fail("it is planned again")).entries == postures.entries
    path.write_bytes(path.read_bytes()[:-100])
    assert postures_of(scene, 1).entries == postures.entries
    assert Postures.load(path).entries == (pea,)


def test_without_a_cache_folder_it_is_planned_every_time(cache: Path) -> None:
    cache.write_text("a file is in its place")
    assert postures_of(make_scene(objects=(PEA,)), 1).entry("Tip", PEA.thing()) is not None


def test_a_changed_shape_is_planned_though_its_name_is_known() -> None:
    larger = thing("bead", "Tip", msgspec.structs.replace(BEAD.shape, diameter_mm=13.0))
    (work,) = lacking(make_scene(objects=(larger,)), SHIPPED)
    assert work.thing.shape == larger.shape


def test_two_objects_of_one_shape_and_type_are_planned_once() -> None:
    twin = msgspec.structs.replace(PEA, name="twin", mass_g=3.0)
    assert len(list(lacking(make_scene(objects=(PEA, twin)), SHIPPED))) == 1


@pytest.mark.slow
def test_the_result_does_not_depend_on_the_number_of_jobs() -> None:
    works = list(lacking(make_scene(objects=(PEA, BALL, BEAN)), SHIPPED))  # the ball is done first
    found = [planned(works, jobs) for jobs in (1, 2, 3)]
    assert [entry.object for entry in found[0]] == ["pea", "ball", "bean"]
    assert found[0] == found[1] == found[2]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_unholdable_objects_are_named_and_the_first_explained(jobs: int) -> None:
    with pytest.raises(SceneError) as refusal:
        postures_of(make_scene(objects=(PEA, MELON, BALL, MOON), subjects=(hand(160.0),)), jobs)
    assert str(refusal.value).startswith("a hand of 165 mm cannot hold 'melon' with grasp type 'CMF': ")
    assert str(refusal.value).endswith("; nor can these be held: 'moon' (CMF)")


def test_what_a_hand_of_the_scene_need_not_hold_is_no_error() -> None:
    entry = postures_of(make_scene(objects=(MELON,), subjects=(hand(222.0),)), 1).entry("CMF", MELON.thing())
    assert entry is not None
    assert entry.covers(222.0)
    assert not entry.covers(160.0)


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
def test_lengths_go_as_far_as_the_hands_of_the_scene(lengths: list[float], first: float, last: float) -> None:
    hands = tuple(map(hand, lengths))
    postures = postures_of(make_scene(objects=(PEA,), subjects=hands), 1)
    entry = postures.entry("Tip", PEA.thing())
    assert entry is not None
    assert [held.length_mm for held in entry.held] == np.arange(first, last + 1.0, 15.0).tolist()
    for subject in hands:
        assert postures.held(subject.hand(), "Tip", PEA.thing()).pads


def test_known_objects_are_replanned_only_beyond_their_hand_lengths() -> None:
    far = make_scene(objects=(BEAD,), subjects=(hand(188.0), hand(238.0)))
    entry, known = (postures.entry("Tip", BEAD.thing()) for postures in (postures_of(far, 1), SHIPPED))
    assert entry is not None
    assert known is not None
    assert entry.held[-1].length_mm == 240.0
    assert np.abs(figures(entry)[:-1] - figures(known)).max() < ROUNDING


def test_a_taxonomy_without_a_table_cannot_be_planned() -> None:
    item = thing("bead", "Tip Pinch", BEAD.shape)
    with pytest.raises(SceneError, match="no table of prehensions for the grasp types of 'feix33': nothing can be pla"):
        postures_of(make_scene(taxonomy="feix33", objects=(item,)), 1)


def test_a_type_that_its_taxonomys_table_lacks_is_named_with_its_object() -> None:
    with pytest.raises(SceneError, match="kamakura14 has no prehension for grasp type 'Hold': 'pea' cannot"):
        postures_of(make_scene(objects=(thing("pea", "Hold", PEA.shape),)), 1)


def test_an_interrupt_passes_through() -> None:
    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        postures_of(make_scene(objects=(PEA, BEAN)), 1, interrupt)
