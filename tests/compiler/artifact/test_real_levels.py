"""Levels of real taxels: what a few of iCub's recognise, in nested folds, alone and with the encoders."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.columns import ColumnRoles, JointColumns, TaxelColumns
from thenar.compiler.recordings.importer import import_table
from thenar.compiler.recordings.table import read_table

FINGERS = ("thumb", "index", "middle", "ring", "little")
# What inner folds choose; the choice itself takes most of the time.
FIXED: dict[str, Any] = {"trainer": "logit", "penalty": 0.3, "smoothness": 1.5, "max_bins": 32}


@pytest.fixture(scope="module")
def pressed(icub_table: Path) -> GraspSet:
    """Return the set with each taxel's fall since the first slice of its trial, as the contact bits of the set have it;
    absolute counts drift from object to object, and would tell them apart by that.
    """
    columns = ColumnRoles(
        label="object",
        trial="rep",
        taxels=(TaxelColumns(tuple(f"{finger}_t*" for finger in FINGERS)),),
        joints=(JointColumns(("enc*",)),),
    )
    recorded, _ = import_table(read_table(icub_table, columns.text), columns)
    frames = np.load(icub_table.with_name("frames.npz"))
    _, first = np.unique(frames["trial_id"], return_index=True)
    fallen = frames["taxels"][first].astype(int) - recorded.taxels + 64
    return replace(recorded, taxels=np.clip(fallen, 0, 255).astype(np.uint16))


@pytest.mark.slow
def test_twelve_taxels_of_three_levels_recognise_what_is_held(pressed: GraspSet, tmp_path: Path) -> None:
    manifest = compile_build(
        pressed, tmp_path / "b", placement="elimination-cost", keep=36, levels=3, at_most_taxels=12,
        inputs="switches", **FIXED
    ).manifest  # fmt: skip
    sources = [switch.source for switch in manifest.switches]
    assert len(set(sources)) <= 12
    assert max(map(sources.count, sources)) <= 3
    assert manifest.headline is not None
    assert manifest.headline.rate >= 0.92


@pytest.mark.slow
def test_taxels_and_encoders_recognise_nearly_all(pressed: GraspSet, tmp_path: Path) -> None:
    manifest = compile_build(pressed, tmp_path / "b", placement="elimination-cost", keep=60, **FIXED).manifest
    assert manifest.headline is not None
    assert manifest.headline.rate >= 0.98
