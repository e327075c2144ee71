"""The whole way on real recordings: imported, compiled, verified, recognised."""

from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import compile_build
from thenar.compiler.build.select import select_inputs
from thenar.compiler.build.verify import verify_build
from thenar.compiler.recordings.importer import import_file
from thenar.runtime import Build, Recognizer
from thenar.runtime.recognizer import Frame

COLUMNS = Path(__file__).parents[3] / "examples" / "columns"


@pytest.mark.parametrize(("table", "columns", "expected"), [("icub_table", "icub", 0.93), ("aml_table", "aml", 0.90)])
def test_a_build_of_real_recordings_holds_and_recognises(
    request: pytest.FixtureRequest, tmp_path: Path, table: str, columns: str, expected: float
) -> None:
    grasp_set, _ = import_file(request.getfixturevalue(table), COLUMNS / f"{columns}.toml")
    manifest = compile_build(grasp_set, tmp_path / "build").manifest
    assert manifest.rates[1].rate >= expected
    varying = np.flatnonzero(grasp_set.switches.any(axis=0) & ~grasp_set.switches.all(axis=0))
    assert {switch.column for switch in manifest.switches} <= set(varying.tolist())

    found = verify_build(tmp_path / "build", grasp_set)
    assert found.holds
    assert found.covered == len(grasp_set)

    recognizer = Recognizer(Build.load(tmp_path / "build"))
    bits, codes = select_inputs(grasp_set, manifest)
    seen = [recognizer.recognise(Frame(0, *frame)).grasp for frame in zip(bits, codes, strict=True)]
    assert np.count_nonzero(np.array(seen) == grasp_set.grasps) == found.correct_integers
