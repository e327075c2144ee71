"""An effect that a scene does not list costs nothing: what it needs is not imported, and nothing is allocated for it.

That a scene imports and runs the effects that it lists and no others: test_decode and test_pipeline.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from thenar.simulator.pipeline.effect import EFFECTS
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline

from .small import make_batch, make_scene

OWN = {f"glove.{step}" for step in ("recall", "threshold", "close", "frames", "sense", "encode", "sample")} | {
    "contact.quasistatic"
}
NEEDED = {"thenar.simulator.pipeline.wire", "thenar.simulator.pipeline.parts", "thenar.drivers.lines"}

# Runs in a fresh interpreter: simulates the effects that it is given on a batch, and prints what was imported.
RUN = """
import importlib.util, json, sys
spec = importlib.util.spec_from_file_location("small", sys.argv[1])
small = importlib.util.module_from_spec(spec)
spec.loader.exec_module(small)
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline
compile_pipeline(small.make_scene(sys.argv[2:])).run([small.make_batch(range(2))], Ledger())
print(json.dumps(sorted(sys.modules)))
"""


def modules_of(*effects: str) -> set[str]:
    command = [sys.executable, "-c", RUN, str(Path(__file__).with_name("small.py")), *effects]
    return set(json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))


def test_what_only_some_effects_need_is_imported_for_these_alone() -> None:
    bare, all_of_them = modules_of(), modules_of(*EFFECTS)
    effects = {f"thenar.simulator.effects.{name.replace('.', '_')}" for name in EFFECTS}
    assert bare & (effects | NEEDED) == {"thenar.simulator.effects.contact_quasistatic"}
    assert all_of_them >= effects | NEEDED
    assert not {"scipy", "sklearn", "matplotlib", "joblib"} & {name.split(".")[0] for name in bare | all_of_them}


def test_a_bare_scene_has_no_arrays_for_what_it_does_not_simulate() -> None:
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
