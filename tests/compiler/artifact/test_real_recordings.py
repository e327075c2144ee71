"""The whole way on real recordings: imported, compiled, verified, recognised."""

from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import compile_build
from thenar.compiler.artifact.training import samples_of
from thenar.compiler.artifact.verify import verify
from thenar.compiler.evaluation.folds import weka_folds
from thenar.compiler.model.collapse import collapse
from thenar.compiler.recogniser import Recogniser
from thenar.compiler.recordings.importer import import_file
from thenar.compiler.samples import select_inputs
from thenar.runtime import Build
from thenar.runtime.manifest import Of
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import Inputs, Recipe

COLUMNS = Path(__file__).parents[3] / "examples" / "columns"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("table", "columns", "expected", "uncovered"),
    [
        # Its discriminants have lines, which are rounded more coarsely than rows.
        ("icub_table", "icub", {"within subject": 0.93}, 1),
        ("aml_table", "aml", {"new subject": 0.70, "pooled": 0.90}, 0),
    ],
)
def test_a_build_of_real_recordings_holds_and_recognises(
    request: pytest.FixtureRequest, tmp_path: Path, table: str, columns: str, expected: dict[Of, float], uncovered: int
) -> None:
    grasp_set, _ = import_file(request.getfixturevalue(table), COLUMNS / f"{columns}.toml")
    manifest = compile_build(grasp_set, tmp_path / "build").manifest
    rates = {rate.of: rate.rate for rate in manifest.rates if rate.protocol == "nested" and rate.unit == "trials"}
    assert list(rates) == list(expected)
    assert all(rates[of] >= least for of, least in expected.items())
    varying = np.flatnonzero(grasp_set.switches.any(axis=0) & ~grasp_set.switches.all(axis=0))
    assert {switch.column for switch in manifest.switches} <= set(varying.tolist())

    found = verify(tmp_path / "build", grasp_set)
    assert found.holds
    assert found.covered == len(grasp_set) - uncovered

    build = Build.load(tmp_path / "build")
    bits, codes = select_inputs(grasp_set, manifest)
    seen = [build.recognise(*frame).grasp for frame in zip(bits, codes, strict=True)]
    assert np.count_nonzero(np.array(seen) == grasp_set.grasps) == found.recognised[-1].integers


@pytest.mark.parametrize("inputs", ["both", "switches"])
@pytest.mark.parametrize("entry_bits", [16, 8])
def test_integers_and_ensemble_differ_by_less_than_a_fifth_point(
    icub_table: Path, inputs: Inputs, entry_bits: int
) -> None:
    grasp_set, _ = import_file(icub_table, COLUMNS / "icub.toml")
    options = Recipe(0, 100, inputs, 1.0, 4, 1)
    material = samples_of(grasp_set, options)
    by_ensemble = by_integers = 0
    for fold in weka_folds(material.labels, options.folds, options.seed):
        made = Recogniser.fit(material, options, fold.train)
        part, test = (made.read(material.rows(rows)) for rows in (fold.train, fold.test))
        tables = collapse(made.model, part.n_switches)
        integers = quantise(tables, part.switches, part.codes, entry_bits=entry_bits)
        scores = test.switches @ integers.switch_rows.astype(int) + integers.bias
        for codes, thresholds, rows in zip(test.codes.T, integers.thresholds, integers.joint_rows, strict=True):
            scores += rows[np.searchsorted(thresholds, codes)]
        found = winners(made.model.scores(test.switches, test.codes))
        by_ensemble += int(np.count_nonzero(found == test.labels))
        by_integers += int(np.count_nonzero(scores.argmax(axis=1) == test.labels))
    assert by_ensemble > len(grasp_set) / 2
    assert abs(by_integers - by_ensemble) <= 0.002 * len(grasp_set)
