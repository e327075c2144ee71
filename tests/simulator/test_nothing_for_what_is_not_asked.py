"""An effect that a scene does not list costs nothing: it is not imported, counted, drawn for or allocated.

Two scenes are simulated in fresh interpreters; each lists what the other does not. So every effect is audited once
where it must not show, and once where it must: the control without which an audit proves nothing.
"""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline
from thenar.simulator.scenes.scene import Scene

# Every scene has a contact model.
NAMES = tuple(name for name in EFFECTS if name != "contact.quasistatic")

ONE = (
    "hand.style",
    "hand.object_pose",
    "switch.threshold",
    "frame.jitter",
    "hand.transition",
    "joint.drift",
    "switch.stuck_open",
    "switch.ghosting",
    "wire.lost_bytes",
)
OTHER = tuple(name for name in NAMES if name not in ONE)
OWN = {f"glove.{step}" for step in ("recall", "threshold", "close", "frames", "sense", "encode", "sample")} | {
    "contact.quasistatic"
}
WIRED = {"glove.send", "glove.receive"}
# Of a scene with taxels, such as OTHER.
FELT = {"glove.feel", "glove.count"}
# These draw no random numbers: what they do follows from what there is.
DRAWS_NOTHING = {
    "contact.ramp",
    "bus.latency",
    "hand.transition",
    "frame.at_force",
    "switch.ghosting",
    "taxel.hysteresis",
    "taxel.creep",
    "taxel.crosstalk",
    "taxel.adc",
}
# What these count beside; the others count nothing.
COUNTS = {
    "contact.quasistatic": ["solver steps"],
    "contact.ramp": ["grips solved", "solver steps"],
    "glove.send": ["bytes sent"],
}
CONFTEST = Path(__file__).with_name("conftest.py")

# Runs in a fresh interpreter: simulates the effects it is given on a batch, and prints what audits saw of each name.
AUDIT = """
import importlib.util, json, sys, tracemalloc

executed = set()
sys.addaudithook(lambda event, args: executed.add(args[0].co_filename) if event == "exec" else None)
spec = importlib.util.spec_from_file_location("small", sys.argv[1])
small = importlib.util.module_from_spec(spec)
spec.loader.exec_module(small)

import thenar.simulator.effects
from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline

batch, ledger = small._batch(range(2)), Ledger()
tracemalloc.start()
compile_pipeline(small._scene(sys.argv[2:])).run([batch], ledger)
effects = tracemalloc.take_snapshot().filter_traces([tracemalloc.Filter(True, "*/simulator/effects/*.py")])
allocated = {file.traceback[0].filename: file.size for file in effects.statistics("filename")}

def audit(name):
    module = name.replace(".", "_")
    ending = f"effects/{module}.py"
    return {
        "imported": f"thenar.simulator.effects.{module}" in sys.modules,
        "executed": any(path.endswith(ending) for path in executed),
        "bytes": sum(size for path, size in allocated.items() if path.endswith(ending)),
    }

print(json.dumps({
    "effects": {name: audit(name) for name in EFFECTS},
    "modules": sorted(sys.modules),
    "steps": {name: [one.own, one.calls, one.draws, dict(one.counters)] for name, one in ledger.entries.items()},
}))
"""


class Audit(NamedTuple):
    """What one fresh interpreter saw."""

    effects: dict[str, dict[str, float]]
    modules: list[str]
    steps: dict[str, tuple[bool, int, int, dict[str, int]]]


def audited(listed: tuple[str, ...]) -> Audit:
    command = [sys.executable, "-c", AUDIT, str(CONFTEST), *listed]
    return Audit(**json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))


@pytest.fixture(scope="module")
def audits() -> dict[tuple[str, ...], Audit]:
    return {listed: audited(listed) for listed in (ONE, OTHER)}


def scenes_of(name: str, audits: dict[tuple[str, ...], Audit]) -> tuple[Audit, Audit]:
    """Return the audit of the scene that lists `name`, and of the one that does not."""
    return (audits[ONE], audits[OTHER]) if name in ONE else (audits[OTHER], audits[ONE])


@pytest.mark.parametrize("name", NAMES)
def test_it_is_imported_where_it_is_listed_and_nowhere_else(name: str, audits: dict[tuple[str, ...], Audit]) -> None:
    control, without = (audit.effects[name] for audit in scenes_of(name, audits))
    assert (control["imported"], control["executed"]) == (True, True)
    assert (without["imported"], without["executed"]) == (False, False)


@pytest.mark.parametrize("name", NAMES)
def test_it_allocates_where_it_is_listed_and_nowhere_else(name: str, audits: dict[tuple[str, ...], Audit]) -> None:
    control, without = (audit.effects[name] for audit in scenes_of(name, audits))
    assert control["bytes"] > 0
    assert without["bytes"] == 0


@pytest.mark.parametrize("name", NAMES)
def test_it_is_called_and_draws_where_it_is_listed_and_nowhere_else(
    name: str, audits: dict[tuple[str, ...], Audit]
) -> None:
    control, without = scenes_of(name, audits)
    own, calls, draws, _ = control.steps[name]
    assert (own, calls) == (False, 1)
    assert (draws == 0) == (name in DRAWS_NOTHING)
    assert name not in without.steps


@pytest.mark.parametrize("listed", [ONE, OTHER])
def test_the_ledger_knows_scene_effects_and_drawless_glove_steps(
    listed: tuple[str, ...], audits: dict[tuple[str, ...], Audit]
) -> None:
    steps = audits[listed].steps
    assert {name for name, (own, *_) in steps.items() if not own} == set(listed)
    assert {name for name, (own, *_) in steps.items() if own} == OWN | WIRED | (FELT if listed == OTHER else set())
    assert all(draws == 0 for own, _, draws, _ in steps.values() if own)


@pytest.mark.parametrize("listed", [ONE, OTHER])
def test_solver_steps_and_bytes_are_counted_by_those_that_make_them(
    listed: tuple[str, ...], audits: dict[tuple[str, ...], Audit]
) -> None:
    for name, (_, _, _, counted) in audits[listed].steps.items():
        assert sorted(counted) == COUNTS.get(name, []), name
        assert all(number > 0 for number in counted.values()), name


def test_what_only_some_effects_need_is_imported_for_these_alone(audits: dict[tuple[str, ...], Audit]) -> None:
    bare = audited(())
    needed = {
        "thenar.simulator.pipeline.wire": (ONE, OTHER),
        "thenar.simulator.pipeline.parts": (ONE, OTHER),
        "thenar.drivers.lines": (ONE, OTHER),
    }
    for module, scenes in needed.items():
        for listed, audit in {**audits, (): bare}.items():
            assert (module in audit.modules) == (listed in scenes), (module, listed)
    for audit in (*audits.values(), bare):
        assert not {"scipy", "sklearn", "matplotlib", "joblib"} & {name.split(".")[0] for name in audit.modules}


def test_a_bare_scene_has_no_arrays_for_what_it_does_not_simulate(
    make_scene: Callable[..., Scene], make_batch: Callable[..., Batch]
) -> None:
    batch, ledger = make_batch(range(3)), Ledger()
    compile_pipeline(make_scene()).run([batch], ledger)
    assert batch.delay_us is None
    assert batch.lost is None
    assert batch.ramp is None
    assert batch.taxels is None
    assert not hasattr(batch, "taxels_n")
    assert not hasattr(batch, "traffic")
    assert batch.bits.shape == (3, 1, 160)
    assert set(ledger.entries) == OWN
    assert all(entry.own and entry.draws == 0 for entry in ledger.entries.values())
    assert np.array_equal(batch.posture_deg[0], batch.posture_deg[1])
