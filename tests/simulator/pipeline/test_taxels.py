"""A glove with taxels: forces frame by frame, counts, and the set that comes of them."""

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.simulator import simulate
from thenar.simulator.body.layout import taxel_places
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline
from thenar.simulator.scenes.scene import Recording, SceneGlove

from ..small import make_batch, make_scene

ALL = SceneGlove(taxels="all")
LOSES: Any = {"rate": 0.02}


def run(*effects: str, **changes: object) -> Batch:
    """Return a batch as the pipeline of effects leaves it, with changes of the scene."""
    batch = make_batch(range(3))
    compile_pipeline(make_scene(effects, glove=ALL, **changes)).run([batch], Ledger())
    return batch


def test_without_effects_counts_are_the_contact_force_in_millinewtons() -> None:
    batch = run()
    assert batch.taxels is not None
    assert batch.forces_n.max() > 1.0
    np.testing.assert_array_equal(batch.taxels[:, 0], np.rint(batch.forces_n * 1000.0))


def test_taxels_feel_nothing_before_contact_and_after_release() -> None:
    batch = run(recording=Recording(rows="all", lead_ms=30.0, hold_ms=50.0, release_ms=40.0))
    held = (batch.frame_us[0] >= 0) & (batch.frame_us[0] < 60_000)
    assert held.sum() == 6
    np.testing.assert_array_equal(batch.taxels_n[:, held], np.repeat(batch.forces_n[:, None], 6, axis=1))
    assert not batch.taxels_n[:, ~held].any()


def test_ramped_taxels_pass_thresholds_when_switches_change() -> None:
    recording = Recording(rows="all", rate_hz=1000.0, lead_ms=10.0, hold_ms=250.0, release_ms=220.0)
    batch = run("contact.ramp", recording=recording)
    assert batch.bits.any()
    # To a rounding of times to microseconds: never further from the threshold than force changes in one.
    differ = batch.bits != (batch.taxels_n > batch.thresholds_n)
    assert (np.abs(batch.taxels_n - batch.thresholds_n)[differ] < 1e-3).all()
    assert (batch.bits == (batch.taxels_n > batch.thresholds_n)).mean() > 0.999
    assert not batch.taxels_n[:, -1].any()


def test_only_named_places_are_taxels() -> None:
    scene = load_scene("quick").varied(repetitions=2, subjects=["A"])
    plain = simulate(scene, 1).grasp_set
    glove = SceneGlove(taxels=("index_distal", "thumb_distal_5"))
    mixed = simulate(replace(scene, glove=glove), 1).grasp_set
    names = [taxel.name for taxel in mixed.taxel_columns]
    assert names == ["thumb_distal_5", *(f"index_distal_{n}" for n in range(1, 9))]
    kept = [plain.switch_names.index(name) for name in mixed.switch_names]
    assert set(mixed.switch_names) == {*plain.switch_names} - {*names}
    np.testing.assert_array_equal(mixed.switches, plain.switches[:, kept])
    np.testing.assert_array_equal(mixed.codes, plain.codes)
    assert {taxel.unit for taxel in mixed.taxel_columns} == {"N"}


def test_the_shipped_taxel_scene_has_12_bit_counts_in_newtons() -> None:
    bits = simulate(load_scene("kamakura").varied(repetitions=2, subjects=["A"]), 1)
    pads = simulate(load_scene("kamakura-analog").varied(repetitions=2, subjects=["A"]), 1)
    assert pads.report.unsettled == bits.report.unsettled
    assert [one.switches_mean for one in pads.report.grasps] == [one.switches_mean for one in bits.report.grasps]
    found = pads.grasp_set
    assert found.taxels.shape == bits.grasp_set.switches.shape
    assert found.taxels.max() <= 4095
    np.testing.assert_array_equal(found.codes, bits.grasp_set.codes)
    newtons = np.stack([column.value(codes) for column, codes in zip(found.taxel_columns, found.taxels.T, strict=True)])
    # Switches that closed are pads that are pressed with about a newton or more.
    closed = bits.grasp_set.switches.T
    assert np.median(newtons[closed]) > 1.0
    assert (newtons[closed] > 0.4).all()
    assert (newtons[~closed] < 2.0).all()
    assert (
        found.fingerprint()
        == simulate(load_scene("kamakura-analog").varied(2, subjects=["A"]), 2).grasp_set.fingerprint()
    )


def test_a_scene_without_the_converter_counts_thousandths() -> None:
    scene = load_scene("kamakura-analog").varied(repetitions=1, subjects=["A"])
    effects = tuple(effect for effect in scene.effects if effect.name != "taxel.adc")
    found = simulate(replace(scene, effects=effects), 1).grasp_set
    assert float(found.taxel_columns[0].value(1)) == pytest.approx(0.001)
    assert found.taxels.max() > 4095


@pytest.mark.parametrize("name", [name for name in EFFECTS if name.startswith("taxel.")])
def test_an_effect_on_taxels_needs_some(name: str) -> None:
    with pytest.raises(SceneError, match=f"^effects.{name}: the glove has no taxels"):
        compile_pipeline(make_scene([name], glove=SceneGlove()))


def test_counts_go_over_the_boards_line_and_come_through_where_nothing_happens() -> None:
    plain, sent = run("taxel.noise"), run("taxel.noise", "wire.lost_bytes")
    assert plain.taxels is not None
    assert sent.taxels is not None
    assert sent.lost is not None
    whole = np.flatnonzero(~sent.lost[:, 0])
    assert whole.size
    np.testing.assert_array_equal(sent.taxels[whole], plain.taxels[whole])


def test_counts_that_are_lost_leave_those_of_the_frame_before() -> None:
    effects: list[str | tuple[str, dict[str, Any]]] = ["contact.ramp", ("wire.lost_bytes", LOSES)]
    recording = Recording(rows="all", rate_hz=20.0, hold_ms=500.0)
    found = []
    for listed in (effects[:1], effects):
        batch = make_batch(range(4))
        compile_pipeline(make_scene(listed, glove=ALL, recording=recording)).run([batch], Ledger())
        assert batch.taxels is not None
        found.append(batch.taxels)
    plain, damaged = found
    for one, other in zip(plain, damaged, strict=True):
        sources = [
            next(at for at in range(frame, -2, -1) if at < 0 or (one[at] == other[frame]).all())
            for frame in range(len(one))
        ]
        assert any(source < frame for frame, source in enumerate(sources)) or (one == other).all()
        assert all((other[frame] == (one[at] if at >= 0 else 0)).all() for frame, at in enumerate(sources))
    assert not np.array_equal(plain, damaged)


def test_a_rate_that_the_line_has_no_time_for_is_refused() -> None:
    with pytest.raises(SceneError, match="request at most 97"):
        compile_pipeline(make_scene(["wire.lost_bytes", "frame.jitter"], glove=ALL))


def test_a_place_that_the_glove_does_not_have_is_refused() -> None:
    with pytest.raises(ValueError, match="no place 'index_tip'"):
        taxel_places(("thumb_distal", "index_tip"))
