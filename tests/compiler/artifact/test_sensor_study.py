"""What sensors are worth: measured in folds, the same on any number of cores, and what a build then keeps."""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from tests.sets import grasp_set_of
from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact.sensor_study import MATTERS, Worth, draw_curve, study_sensors
from thenar.compiler.pictures import PictureError
from thenar.compiler.placement.constraints import Limits
from thenar.runtime.manifest_file import manifest_from_bytes
from thenar.runtime.recipe import Inputs, Recipe
from thenar.simulator.handmaps.handmap import hand_map


def people(noise: float = 0.15, switches: int = 8) -> GraspSet:
    """Return 3 types of 4 people, 6 trials of each: switches of which some tell the types, and two joints."""
    random, n = np.random.default_rng(6), 72
    labels, subjects = np.arange(n) % 3, np.repeat(np.array(list("ABCD")), n // 4)
    told = (random.random((3, switches)) < 0.5)[labels] ^ (random.random((n, switches)) < noise)
    codes = np.array([[60, 90], [120, 70], [100, 160]])[labels] + random.integers(-30, 30, (n, 2))
    return grasp_set_of(["cup", "pen", "rod"], labels, switches=told, codes=codes, subjects=subjects)


def test_the_worth_of_a_sensor_is_paired_over_people() -> None:
    random = np.random.default_rng(1)
    clusters = np.repeat(np.arange(6), 20)
    before = random.random(120) < 0.6
    hits = before | (random.random(120) < 0.3)
    worth = Worth.of(hits, before, clusters)
    gains = [hits[clusters == one].mean() - before[clusters == one].mean() for one in range(6)]
    low, high = stats.t.interval(0.95, 5, np.mean(gains), stats.sem(gains))
    assert (worth.mean, worth.low, worth.high) == pytest.approx((np.mean(gains), low, high), abs=1e-6)


@pytest.mark.parametrize("number", [1, 3])
def test_a_point_of_the_curve_is_that_of_its_number_alone(number: int) -> None:
    curve, alone = (study_sensors(people(), Recipe(sensors=most), jobs=1) for most in (None, number))
    point, found = curve.points[number - 1], alone.point
    assert (point.mean, point.low, point.high, point.adapted, point.papers) == (
        found.mean,
        found.low,
        found.high,
        found.adapted,
        found.papers,
    )
    assert point.sensors == found.sensors
    assert point.mean < curve.points[-1].mean


def test_the_curve_is_measured_in_folds_and_the_same_on_any_number_of_cores() -> None:
    grasp_set, seen = people(), list[tuple[int, int]]()
    study = study_sensors(grasp_set, Recipe(), jobs=2, report=lambda *done: seen.append(done))
    rough = list[tuple[int, int, dict[int, float]]]()
    assert study == study_sensors(grasp_set, Recipe(), jobs=1, rough=lambda *so_far: rough.append(so_far))
    assert seen == [(done, 5) for done in range(1, 6)]
    # Every trial has as many rows, so the last of the rough curves is that of rows.
    assert [(done, folds) for done, folds, _ in rough] == [(done, 4) for done in range(1, 5)]
    assert rough[-1][2] == pytest.approx({point.number: point.mean for point in study.points}, abs=0.05)
    assert (study.of, study.folds, study.there) == ("new subject", 4, 10)
    assert [point.number for point in study.points] == list(range(1, 11))
    for before, point in zip(study.points, study.points[1:], strict=False):
        assert {*point.sensors} == {*before.sensors, *point.added} - {*point.removed}
        assert point.worth is not None
        assert point.worth.mean == pytest.approx(point.mean - before.mean)
        assert point.worth.low <= point.worth.mean <= point.worth.high
    last = study.points[-1]
    assert last.adapted is not None
    assert last.papers is not None
    assert last.low < last.mean < last.high
    assert last.mean > 0.9
    means = {point.number: point.mean for point in study.points}
    later = [means[number] for number in (study.enough + 1, study.enough + 2) if number in means]
    assert max(later, default=0) < means[study.enough] + MATTERS
    assert study.point.number == study.enough
    assert all(0 <= row.folds <= 4 for row in study.chosen)
    assert {row.name for row in study.chosen} == {*study.point.sensors}
    assert not {*study.left_out} & {row.name for row in study.chosen}


def test_a_study_is_drawn_the_same_each_time_and_a_dollar_is_a_dollar() -> None:
    grasp_set = replace(people(), switch_names=(r"$\left{$", *"abcdefg"))
    study = study_sensors(grasp_set, Recipe(sensors=3, have=(r"$\left{$",)), jobs=1)
    hand = replace(hand_map(), names=(*grasp_set.switch_names, *hand_map().names[8:]))
    pictures = [draw_curve(study, hand, kind) for kind in ("svg", "svg", "png", "png")]
    assert pictures[0] == pictures[1]
    assert pictures[2] == pictures[3]
    text = pictures[0].decode()
    root = ElementTree.fromstring(text)
    assert {"width", "height"}.isdisjoint(root.attrib)
    sizes = [100 * float(scale) for scale in re.findall(r"scale\((\d*\.\d+) -", text)]
    assert min(sizes) * 400 / float(root.attrib["viewBox"].split()[2]) >= 11
    numbers = [str(number) for number, row in enumerate(study.chosen, 1) if hand.knows([row.name])]
    assert [words for words in re.findall(r"<!-- (\d+) -->", text) if words in numbers][-len(numbers) :] == numbers
    with pytest.raises(PictureError, match=r"ends in \.png or \.svg, not in \.pdf"):
        draw_curve(study, None, "pdf")


def test_what_tells_nothing_is_worth_nothing() -> None:
    grasp_set = people(noise=0.5, switches=40)
    codes = np.random.default_rng(2).integers(0, 200, grasp_set.codes.shape).astype(np.uint16)
    nothing = replace(grasp_set, codes=codes)
    study = study_sensors(nothing, Recipe(sensors=16), jobs=1)
    # Chosen from all rows, the best 16 of 42 would seem to recognise most trials.
    assert study.point.mean < 0.5


@pytest.mark.parametrize("inputs", ["both", pytest.param("switches", marks=pytest.mark.slow), "joints"])
def test_a_build_keeps_the_sensors_of_the_study(inputs: Inputs, tmp_path: Path) -> None:
    grasp_set, recipe = people(), Recipe(sensors=2, inputs=inputs, folds=2)
    study = study_sensors(grasp_set, recipe, jobs=1)
    made = compile_build(grasp_set, tmp_path / "build", recipe, trainer="discriminant", jobs=1)
    manifest = manifest_from_bytes((made.folder / "build.json").read_bytes())
    assert manifest.options.sensors == 2
    kept = {switch.name for switch in manifest.switches} | {joint.name for joint in manifest.joints}
    assert kept == {row.name for row in study.chosen}
    assert {joint.name for joint in manifest.joints} == {row.name for row in study.chosen if row.kind == "joint"}
    assert len(study.points) == 1


def test_more_sensors_than_a_curve_has_can_be_there_already() -> None:
    grasp_set = people(switches=20)
    recipe = Recipe(have=grasp_set.switch_names[:18])
    study = study_sensors(grasp_set, recipe, limits=Limits.of(recipe, grasp_set, {}), jobs=1)
    assert [point.number for point in study.points] == [18]


def test_prices_limit_what_is_bought() -> None:
    grasp_set = people()
    prices = dict.fromkeys([*grasp_set.switch_names, *grasp_set.joint_names], 4.0)
    recipe = Recipe(price=10.0)
    study = study_sensors(grasp_set, recipe, limits=Limits.of(recipe, grasp_set, {}, prices=prices), jobs=1)
    assert (len(study.chosen), study.price) == (2, 8.0)
