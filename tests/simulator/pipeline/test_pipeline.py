"""The pipeline: what a scene lists, in order, and what cannot be compiled."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import EFFECTS, hold_frame
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline
from thenar.simulator.scenes.scene import Recording, Scene

from ..small import make_batch, make_scene

NAMES = tuple(EFFECTS)


OWN = {
    "glove.recall",
    "glove.threshold",
    "glove.close",
    "glove.frames",
    "glove.sense",
    "glove.encode",
    "glove.sample",
}
WIRED = {"glove.send", "glove.receive"}
FELT = {"glove.feel", "glove.count"}
OTHERS = [name for name in NAMES if name != "contact.quasistatic"]
EVERYTHING = ["contact.quasistatic", *OTHERS]
SUBSETS = st.sets(st.sampled_from(OTHERS)).map(lambda others: ["contact.quasistatic", *sorted(others)])


def light() -> list[tuple]:
    """Return all effects but the contact model: the ramp in two levels, the bus as it reads all that it can."""
    special: dict[str, dict[str, Any]] = {"contact.ramp": {"levels": 2}, "bus.latency": {"jitter_us": 20.0}}
    return [(name, special.get(name, {})) for name in OTHERS]


def order(scene: Scene) -> list[str]:
    return [stop.effect.name for stop in compile_pipeline(scene).steps]


@given(names=SUBSETS)
def test_a_pipeline_holds_only_scene_effects_and_glove_steps(names: list[str]) -> None:
    stops = compile_pipeline(make_scene(names)).steps
    on_wire = any(name.startswith("wire.") for name in names)
    assert sorted(stop.effect.name for stop in stops if not stop.own) == sorted(names)
    felt = any(name.startswith("taxel.") for name in names)
    own = OWN | (WIRED if on_wire else set()) | (FELT if felt else set())
    assert {stop.effect.name for stop in stops if stop.own} == own


@given(names=SUBSETS, seed=st.integers(0, 100))
def test_the_order_is_that_of_the_numbers_however_the_scene_lists_them(names: list[str], seed: int) -> None:
    scene = make_scene(names)
    shuffled = np.random.default_rng(seed).permutation(len(names))
    mixed = replace(scene, effects=tuple(scene.effects[place] for place in shuffled))
    assert order(mixed) == order(scene)
    stops = compile_pipeline(scene).steps
    numbers = [stop.effect.order for stop in stops]
    assert numbers == sorted(numbers)


def test_the_order_of_everything() -> None:
    assert " ".join(order(make_scene(EVERYTHING))) == (
        "glove.recall hand.style hand.posture hand.object_pose hand.grip contact.quasistatic "
        "glove.threshold switch.threshold glove.close contact.ramp "
        "glove.frames frame.at_force frame.jitter bus.latency "
        "glove.sense hand.transition joint.noise joint.drift glove.encode glove.feel "
        "taxel.gain taxel.hysteresis taxel.creep taxel.crosstalk taxel.noise "
        "glove.sample glove.count "
        "switch.bounce switch.stuck_open switch.stuck_closed switch.ghosting port.dead taxel.adc "
        "glove.send wire.lost_bytes wire.damaged_bytes glove.receive"
    )


class Watched(Batch):
    """A batch that notes which of its fields are read and written."""

    def __getattribute__(self, name: str) -> object:
        if name in FIELDS:
            object.__getattribute__(self, "seen").append(("reads", name))
        return super().__getattribute__(name)

    def __setattr__(self, name: str, value: object) -> None:
        if name in FIELDS:
            object.__getattribute__(self, "seen").append(("writes", name))
        super().__setattr__(name, value)

    def taken(self) -> tuple[set[str], set[str]]:
        """Return what was read and what was written since the last time."""
        seen: list[tuple[str, str]] = object.__getattribute__(self, "seen")
        reads, writes = ({name for kind, name in seen if kind == asked} for asked in ("reads", "writes"))
        seen.clear()
        return reads, writes


FIELDS = set(Batch.__dataclass_fields__) - {"condition", "repetitions"}


def test_every_step_reads_and_writes_what_it_says() -> None:
    plain = make_batch(range(2))
    batch = Watched.__new__(Watched)
    object.__setattr__(batch, "seen", [])
    batch.__init__(plain.condition, plain.repetitions, plain.trials, plain.previous_deg)  # type: ignore[misc]
    batch.taken()
    for name in OTHERS:
        assert {*EFFECTS[name].reads, *EFFECTS[name].writes} <= FIELDS
    pipeline = compile_pipeline(make_scene(["contact.quasistatic", *light()]))
    written = {"trials", "previous_deg", "rest_deg", "delay_us", "lost", "ramp", "taxels"}
    for stop in pipeline.steps:
        single = type(pipeline)(pipeline.setting, (stop,))
        single.run([batch], Ledger())
        effect, (reads, writes) = stop.effect, batch.taken()
        assert writes == set(effect.writes), effect.name
        # Whether a field is read that the step itself writes is its own affair.
        assert (reads ^ set(effect.reads)) <= set(effect.writes), effect.name
        assert set(effect.reads) <= written, effect.name
        written |= writes


def test_a_scene_without_contact_model_gets_the_gloves_default() -> None:
    stops = compile_pipeline(make_scene(["hand.grip"])).steps
    assert [(s.effect.name, s.own) for s in stops if s.effect.order < 300] == [
        ("glove.recall", True),
        ("hand.grip", False),
        ("contact.quasistatic", True),
    ]


def test_lead_and_release_do_not_change_the_read_frame() -> None:
    """Of every effect: what is drawn for a frame hangs on its time, not on how many come before and after it."""
    found = []
    for lead_ms, release_ms in ((30.0, 40.0), (200.0, 0.0)):
        recording = Recording(lead_ms=lead_ms, hold_ms=250.0, release_ms=release_ms)
        pipeline = compile_pipeline(make_scene(light(), recording=recording))
        batch, held = make_batch(range(2)), hold_frame(pipeline.setting)
        pipeline.run([batch], Ledger())
        assert batch.lost is not None
        assert batch.taxels is not None
        read = (batch.bits, batch.sensors_deg, batch.raw, batch.taxels, batch.lost, batch.frame_us)
        found.append([each[:, held] for each in read])
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_run_enters_every_step_with_its_batches() -> None:
    pipeline, ledger = compile_pipeline(make_scene(["hand.grip", "joint.noise"])), Ledger()
    pipeline.run([make_batch(range(3)), make_batch(range(2))], ledger)
    pipeline.run([make_batch(range(4))], ledger)
    assert list(ledger.entries) == [stop.effect.name for stop in pipeline.steps]
    for entry in ledger.entries.values():
        assert (entry.calls, entry.grasps) == (3, 9)
        assert entry.nanoseconds > 0
    assert ledger.entries["hand.grip"].draws == 9
    assert ledger.entries["joint.noise"].draws == 9 * 2 * 18
    assert ledger.entries["contact.quasistatic"].counters["solver steps"] >= 9
