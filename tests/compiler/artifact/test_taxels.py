"""Builds of recordings with analog pads, whose thresholds are learnt: inside the folds, and written for the board."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.cli import run
from thenar.cli.place_command import command as place_command
from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact import CompileError
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.artifact.training import cuts_of
from thenar.compiler.artifact.verify import verify
from thenar.compiler.placement.elements import LEVELS, bits_of, elements_of, names_of
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.samples import Samples
from thenar.runtime.recipe import Recipe

from ..conftest import make_set

PADS = tuple(Joint(f"pad{number}", "N", 0, 0.0, 4095, 20.0) for number in range(3))
FALLING = Joint("pull-up", "V", 0, 5.0, 4095, 0.0)


def with_pads(plain: GraspSet, n_switches: int = 2) -> GraspSet:
    """Return the set with its first switches, and with pads that are pressed where the next ones were closed."""
    pressed = plain.switches[:, n_switches : n_switches + 4]
    random = np.random.default_rng(5)
    codes = np.where(pressed, random.normal(1500, 300, pressed.shape), random.normal(200, 80, pressed.shape))
    return replace(
        plain,
        switches=plain.switches[:, :n_switches],
        switch_names=plain.switch_names[:n_switches],
        taxels=np.clip(codes, 0, 4095).astype(np.uint16),
        taxel_columns=(*PADS, FALLING),
    )


@pytest.fixture(scope="module")
def padded() -> GraspSet:
    return with_pads(make_set(subjects=2))


def test_a_build_says_at_which_value_each_kept_pad_switches(padded: GraspSet, tmp_path: Path) -> None:
    manifest = compile_build(padded, tmp_path / "build", rounds=5, documents=Documents()).manifest
    elements = elements_of(Samples.of(padded))
    assert (manifest.source.switches, manifest.source.taxels, manifest.source.joints) == (2, 4, 3)
    pads = [switch for switch in manifest.switches if switch.threshold is not None]
    assert len(pads) > len({pad.column for pad in pads})
    for pad in pads:
        threshold = pad.threshold
        assert threshold is not None
        taxel = padded.taxel_columns[threshold.taxel.column]
        assert (pad.column, threshold.code) in elements
        assert (pad.column, pad.source) == (2 + threshold.taxel.column, taxel.name)
        assert pad.name == f"{taxel.name}>{threshold.code}"
        assert threshold.value == pytest.approx(float(taxel.value(threshold.code + 0.5)))
    rising, falling = (next(pad.closed for pad in pads if pad.source == name) for name in ("pad0", "pull-up"))
    assert rising.startswith("closed above ")
    assert " N (codes above " in rising
    assert falling.startswith("closed below ")
    text = " ".join((tmp_path / "build" / "spec" / "README.txt").read_text().split())
    assert re.search(r"is the pad pad0, whose counts thenar compares: .*" + re.escape(rising), text)
    assert rising in (tmp_path / "build" / "report.html").read_text()


def test_it_answers_as_a_build_of_the_switches_that_the_pads_become(padded: GraspSet, tmp_path: Path) -> None:
    made = compile_build(padded, tmp_path / "pads", rounds=5, folds=0)
    samples = Samples.of(padded)
    elements = elements_of(samples)
    bits, names = bits_of(samples, elements).switches, names_of(padded, elements)
    plain = replace(padded, switches=bits, switch_names=names, taxel_columns=(), taxels=np.empty(0, np.uint16))
    compile_build(plain, tmp_path / "plain", rounds=5, folds=0)
    for member in ("tables.bin", "ensemble.bin"):
        assert (tmp_path / "pads" / member).read_bytes() == (tmp_path / "plain" / member).read_bytes()
    found = verify(tmp_path / "pads", padded)
    assert found.holds
    assert found.recognised[0].integers == made.manifest.rates[0].correct


def test_levels_are_learnt_inside_each_fold(padded: GraspSet, tmp_path: Path) -> None:
    """The rates are those of builds of the training rows alone, whose thresholds are others than those of all rows."""
    rates = compile_build(padded, tmp_path / "build", rounds=5).manifest.rates[1:]
    everything, seen = elements_of(Samples.of(padded)), set()
    for rate, cut in zip(rates, cuts_of(padded, Recipe()), strict=True):
        correct = 0
        for fold in cut.folds:
            made = compile_build(padded.rows(fold.train), tmp_path / "fold", rounds=5, folds=0)
            seen.add(made.recogniser.selection.elements)
            correct += verify(tmp_path / "fold", padded.rows(fold.test)).recognised[0].integers
        assert rate.correct == correct
    assert seen - {everything}


def test_pads_of_another_scale_or_kind_are_refused(padded: GraspSet, tmp_path: Path) -> None:
    compile_build(padded, tmp_path / "build", rounds=2, folds=0)
    scaled = replace(padded, taxel_columns=(replace(PADS[0], value_b=10.0), *padded.taxel_columns[1:]))
    with pytest.raises(CompileError, match="taxel pad0 is coded differently here"):
        verify(tmp_path / "build", scaled)
    bits = replace(
        padded,
        switches=np.hstack([padded.switches, padded.taxels > 700]),
        switch_names=padded.element_names,
        taxels=np.empty(0, np.uint16),
        taxel_columns=(),
    )
    with pytest.raises(CompileError, match="is a switch here, but a taxel in the build"):
        verify(tmp_path / "build", bits)


def test_joints_alone_need_no_thresholds(padded: GraspSet, tmp_path: Path) -> None:
    assert not compile_build(padded, tmp_path / "joints", rounds=2, folds=2, inputs="joints").manifest.switches
    alone = replace(padded, switches=np.zeros((96, 0), bool), switch_names=())
    assert compile_build(alone, tmp_path / "pads", rounds=2, folds=2, inputs="switches").manifest.switches


def test_the_best_joints_are_read_alone_by_name(tmp_path: Path) -> None:
    """That they are chosen inside each fold: test_compile."""
    recorded = make_set(subjects=2, joints=3)
    options: dict[str, Any] = {"rounds": 4, "keep_joints": 2}
    build = compile_build(recorded, tmp_path / "build", folds=0, **options)
    kept = [joint.column for joint in build.manifest.joints]
    assert len(kept) == 2 < len(recorded.joints)
    assert [joint.name for joint in build.manifest.joints] == [recorded.joint_names[column] for column in kept]
    assert build.tables.n_joints == 2
    assert verify(tmp_path / "build", recorded).holds
    with pytest.raises(CompileError, match="the recordings have no joints to choose from"):
        compile_build(recorded, tmp_path / "none", inputs="switches", **options)


def test_commands_choose_levels_and_joints(padded: GraspSet, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    padded.save(path := tmp_path / "set.grasps")
    few = ["--method", "elimination-cost", "--keep", "4", "--keep-joints", "1"]
    assert run(["compile", str(path), "-o", str(tmp_path / "build"), "--rounds", "4", "--folds", "0", *few]) == 0
    said = capfd.readouterr().out
    assert re.search(r"from \d of 2 switches, \d of 4 pads \(\d levels?\) and 1 of \d joints;", said)
    assert re.search(
        rf"\njoints: ({'|'.join(padded.joint_names)})(; a CyberGlove's record of them takes .* ms)?\n", said
    )
    assert run(["place", str(path), "--levels", "1", *few, "--json"]) == 0
    placed = json.loads(capfd.readouterr().out)
    assert (placed["sensors"]["switches"][1] + placed["sensors"]["pads"][1], len(placed["kept_joints"])) == (6, 1)
    assert all(("above" in kept) == (kept["number"] > 1) for kept in placed["switches"])
    assert run(["place", str(path), *few]) == 0
    said = " ".join(capfd.readouterr().out.split())
    assert re.search(r"\d of 2 switches, \d of 4 pads \(\d levels?\) and 1 of \d joints", said)
    (levels,) = (each for each in place_command.params if each.name == "levels")
    assert f"[default: {LEVELS}]" in str(getattr(levels, "help", ""))
