import gc
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from thenar.simulator import load_scene, simulate
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.report import SimulationReport
from thenar.simulator.pipeline.simulation import Simulation
from thenar.simulator.scenes.scene import ListedEffect, Scene

from ...conftest import peak_bytes


def scene_of(name: str, repetitions: int, types: tuple[str, ...] = (), **changes: object) -> Scene:
    scene = load_scene(name)
    objects = tuple(item for item in scene.objects if not types or item.grasp in types)
    return msgspec.structs.replace(scene, repetitions=repetitions, objects=objects, **changes)


def hasty(scene: Scene, most_steps: int) -> Scene:
    """Return a scene whose contact model gives up early."""
    listed = ListedEffect("contact.quasistatic", (("most_steps", most_steps),))
    return msgspec.structs.replace(scene, effects=(*scene.effects, listed))


def without_times(report: SimulationReport) -> SimulationReport:
    steps = tuple(
        msgspec.structs.replace(each, seconds=0.0, us_a_grasp=0.0, share=0.0, calls=0) for each in report.steps
    )
    return msgspec.structs.replace(report, seconds=0.0, steps=steps)


QUICK = scene_of("quick", 6, ("PoS", "Tpd", "Tip"))


@pytest.fixture(scope="module")
def quick() -> Simulation:
    return simulate(QUICK, jobs=1, keep_unsettled=True)


@pytest.mark.slow
@pytest.mark.parametrize(("jobs", "block"), [(1, 1), (1, 7), (2, 1), (2, 7), (2, 64)])
def test_any_number_of_processes_and_any_blocks_give_the_same_bytes(
    quick: Simulation, jobs: int, block: int, tmp_path: Path
) -> None:
    quick.grasp_set.save(tmp_path / "one.grasps")
    simulate(QUICK, jobs=jobs, block=block, keep_unsettled=True).grasp_set.save(tmp_path / "other.grasps")
    assert (tmp_path / "other.grasps").read_bytes() == (tmp_path / "one.grasps").read_bytes()


@pytest.mark.parametrize("name", ["faulty-glove", "continuous"])
def test_timed_and_wired_scenes_do_not_depend_on_blocks(name: str) -> None:
    scene = scene_of(name, 3, ("PoH",))
    whole = simulate(scene, jobs=1)
    for block in (1, 2):
        part = simulate(scene, jobs=1, block=block)
        assert part.grasp_set.fingerprint() == whole.grasp_set.fingerprint()
        # What is drawn once a batch is drawn more often in more batches; nothing else differs.
        same = [msgspec.structs.replace(without_times(each.report), steps=()) for each in (part, whole)]
        assert same[0] == same[1]


def test_a_subject_alone_is_as_in_the_whole_scene(quick: Simulation) -> None:
    alone = simulate(msgspec.structs.replace(QUICK, subjects=QUICK.subjects[1:]), jobs=1, keep_unsettled=True).grasp_set
    rows = quick.grasp_set.rows(quick.grasp_set.subjects == QUICK.subjects[1].name)
    assert alone.fingerprint() == rows.fingerprint()


def grasps_of(found: Simulation) -> list[tuple[str, str, str, bytes, bytes]]:
    made = found.grasp_set
    names = zip(made.subjects.tolist(), made.grasps.tolist(), made.objects.tolist(), strict=True)
    rows = zip(names, made.switches, made.codes, strict=True)
    return sorted((*who, bits.tobytes(), codes.tobytes()) for who, bits, codes in rows)


def test_more_grasps_are_those_a_longer_scene_adds(quick: Simulation) -> None:
    fresh = simulate(QUICK.varied(more=5), jobs=1, keep_unsettled=True)
    longer = simulate(QUICK.varied(11), jobs=1, keep_unsettled=True)
    assert grasps_of(longer) == sorted(grasps_of(quick) + grasps_of(fresh))
    assert not {*grasps_of(quick)} & {*grasps_of(fresh)}
    for subject in ("A", "C"):
        before, after = (each.grasp_set.trials[each.grasp_set.subjects == subject] for each in (quick, fresh))
        assert after.tolist() == list(range(len(before), len(before) + 3 * 5))
    assert fresh.grasp_set.simulated == "scene quick, seed 1, 5 more after 6 repetitions"
    assert (fresh.report.done, fresh.report.repetitions) == (6, 2 * 3 * 5)


def test_fresh_grasps_are_another_thing_than_another_seed_which_has_other_habits() -> None:
    still = QUICK.varied(1)
    still = msgspec.structs.replace(still, effects=tuple(each for each in QUICK.effects if each.name == "hand.style"))
    first, fresh, seed = (simulate(each, jobs=1) for each in (still, still.varied(more=2), still.varied(seed=2)))
    assert {*grasps_of(fresh)} >= {*grasps_of(first)}  # nothing varies between repetitions: the hands are the same
    assert not {*grasps_of(seed)} & {*grasps_of(first)}


# The most that is kept of a repetition: a row is 61 bytes packed and some 300 unpacked with its labels; a repetition on
# its way through the pipeline takes more than 30 000.
KEPT_BYTES = 2000


def memory_of(scene: Scene) -> int:
    simulate(scene, jobs=1, block=8)  # what is loaded and cached once is not counted
    gc.collect()  # nor does the peak depend on when the collector comes by
    return peak_bytes(lambda: simulate(scene, jobs=1, block=8))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quick", "faulty-glove"])
def test_memory_grows_by_what_is_kept_of_a_repetition_and_no_more(name: str) -> None:
    few, many = (scene_of(name, repetitions, ("PoS",)) for repetitions in (16, 64))
    few, many = (
        msgspec.structs.replace(scene, recording=msgspec.structs.replace(scene.recording, rows="last"))
        for scene in (few, many)
    )
    # Two subjects: 96 repetitions more.
    assert memory_of(many) - memory_of(few) < 96 * KEPT_BYTES


def test_codes_are_on_one_scale_for_all_or_the_bare_bytes(quick: Simulation) -> None:
    glove = msgspec.structs.replace(QUICK.glove, codes="raw")
    raw = simulate(msgspec.structs.replace(QUICK, glove=glove), jobs=1, keep_unsettled=True).grasp_set
    common = quick.grasp_set
    assert raw.codes.max() <= 255
    assert [joint.name for joint in raw.joints] == [joint.name for joint in common.joints]
    assert common.joints[0].step == 0.5
    # The same hands: the angles agree up to what the subject's calibration differs from the typical one.
    by_raw, by_common = (
        np.stack([joint.value(column) for joint, column in zip(made.joints, made.codes.T, strict=True)])
        for made in (raw, common)
    )
    assert np.abs(by_raw - by_common).max() < 45.0
    assert np.corrcoef(by_raw.ravel(), by_common.ravel())[0, 1] > 0.95


def test_every_frame_is_a_row_when_the_scene_says_so() -> None:
    scene = scene_of("continuous", 2, ("PoS", "Tip"))
    made = simulate(scene, jobs=1, keep_unsettled=True)
    frames = 1 + (300 + 500 + 200) // 10
    assert len(made.grasp_set) == frames * 2 * 2 * 2
    assert made.grasp_set.trials.tolist() == np.tile(np.repeat(np.arange(4), frames), 2).tolist()
    one_each = msgspec.structs.replace(scene, recording=msgspec.structs.replace(scene.recording, rows="last"))
    last = simulate(one_each, jobs=1, keep_unsettled=True)
    held = frames - 1 - 200 // 10
    read_out = made.grasp_set.rows(np.arange(held, len(made.grasp_set), frames))
    assert replace(read_out, times_us=last.grasp_set.times_us).fingerprint() == last.grasp_set.fingerprint()
    assert not last.grasp_set.times_us.size
    # Reports tell of the frames that are read out, in both.
    assert [each.switches_mean for each in made.report.grasps] == [each.switches_mean for each in last.report.grasps]


def test_unsettled_grasps_are_left_out_unless_requested() -> None:
    scene = hasty(QUICK, 12)
    left_out, kept = simulate(scene, jobs=1), simulate(scene, jobs=1, keep_unsettled=True)
    unsettled = left_out.report.unsettled
    assert 0 < len(unsettled) < 36
    assert unsettled == kept.report.unsettled
    assert len(kept.grasp_set) == 36
    gone = {(one.subject, one.trial, one.grasp, one.object) for one in unsettled}
    made = kept.grasp_set
    keys = zip(made.subjects.tolist(), made.trials.tolist(), made.grasps.tolist(), made.objects.tolist(), strict=True)
    stay = np.array([key not in gone for key in keys])
    assert made.rows(stay).fingerprint() == left_out.grasp_set.fingerprint()
    assert [one.unsettled for one in left_out.report.grasps] == [one.unsettled for one in kept.report.grasps]
    assert sum(one.unsettled for one in left_out.report.grasps) == len(unsettled)
    assert not left_out.report.kept_unsettled
    assert kept.report.kept_unsettled


def test_an_object_of_ones_own_is_planned_and_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (bead,) = (item for item in QUICK.objects if item.name == "bead")
    pea = msgspec.structs.replace(bead, name="pea", shape=msgspec.structs.replace(bead.shape, diameter_mm=7.5))
    scene = msgspec.structs.replace(QUICK, objects=(*QUICK.objects, pea))
    seen: list[tuple[int, int]] = []
    found = simulate(scene, jobs=1, progress=lambda *done: seen.append(done), keep_unsettled=True).grasp_set
    assert "pea" in found.objects
    assert seen[0] == (1, 1)  # the plan
    assert simulate(scene, jobs=1, keep_unsettled=True).grasp_set.fingerprint() == found.fingerprint()


def test_a_scene_in_which_nothing_settles_is_an_error() -> None:
    with pytest.raises(SceneError, match="none of its 36 repetitions can be trusted; of the first, the hand did not"):
        simulate(hasty(QUICK, 1), jobs=1)


def test_a_scene_without_arriving_bytes_blames_no_hand() -> None:
    lossy = ListedEffect("wire.lost_bytes", (("rate", 0.999),))
    scene = msgspec.structs.replace(QUICK, effects=(*QUICK.effects, lossy))
    with pytest.raises(SceneError, match="of the first, no frame arrived whole"):
        simulate(scene, jobs=1)


def test_the_report_says_what_came_out_and_that_it_is_simulated(quick: Simulation) -> None:
    report = quick.report
    assert report.simulated
    assert (report.scene, report.seed, report.subjects, report.repetitions) == ("quick", 1, ("A", "C"), 36)
    made = quick.grasp_set
    for one in report.grasps:
        own = made.switches[made.grasps == one.grasp]
        closed = own.sum(axis=1)
        if len(own):
            assert (one.rows, one.repetitions) == (len(own), 12)
            assert (one.switches_least, one.switches_most) == (closed.min(), closed.max())
            assert one.switches_mean == pytest.approx(closed.mean())
            assert one.patterns == len(np.unique(own, axis=0))
            assert one.no_contact == np.count_nonzero(closed == 0)
        else:
            assert (one.rows, one.repetitions) == (0, 0)


def test_reports_of_several_processes_are_added_up(quick: Simulation) -> None:
    assert without_times(simulate(QUICK, jobs=2, keep_unsettled=True).report) == without_times(quick.report)


@pytest.mark.parametrize("jobs", [1, 2])
def test_progress_counts_repetitions_up_to_all_of_them(jobs: int) -> None:
    seen: list[tuple[int, int]] = []
    simulate(QUICK, jobs=jobs, block=2, progress=lambda done, total: seen.append((done, total)))
    assert seen == sorted(seen)
    assert seen[-1] == (36, 36)
