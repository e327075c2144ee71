"""Weka itself opens what is exported."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.recordings.export import export
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import own

pytestmark = pytest.mark.slow

AWKWARD = ("it's", '50 % "x"', "a, b", "{0}", "\\n", "semi;colon", "plain", "two words")


@pytest.fixture
def awkward() -> GraspSet:
    """Names that need quotes everywhere that a name can stand."""
    random = np.random.default_rng(7)
    return GraspSet(
        switches=random.random((40, 4)) < 0.5,
        switch_names=AWKWARD[:4],
        codes=random.integers(0, 200, (40, 4), dtype=np.uint16),
        joints=tuple(Joint(name, "deg", 0, -20.0, 1000, 480.0) for name in AWKWARD[4:]),
        grasps=np.array(AWKWARD * 5),
        taxonomy=own(AWKWARD),
        subjects=random.choice(AWKWARD, 40),
        objects=random.choice(AWKWARD, 40),
        trials=np.arange(40),
    )


def test_weka_reads_every_name_row_and_type(weka: Callable[..., str], awkward: GraspSet, tmp_path: Path) -> None:
    export(awkward, tmp_path / "table.arff")
    report = weka("weka.core.Instances", str(tmp_path / "table.arff"))
    assert "Num Instances:  40" in report
    assert "Num Attributes: 9" in report
    kinds = [line.split()[-12:] for line in report.splitlines() if line[:4].strip().isdecimal()]
    nominal = ["Nom" in line for line in kinds]
    assert nominal == [*[True] * 4, *[False] * 4, True]


def test_weka_gives_back_the_values_and_the_grasp_types(
    weka: Callable[..., str], awkward: GraspSet, tmp_path: Path
) -> None:
    export(awkward, tmp_path / "table.arff")
    weka("weka.core.converters.CSVSaver", "-i", str(tmp_path / "table.arff"), "-o", str(tmp_path / "table.csv"))
    rows = (tmp_path / "table.csv").read_text().splitlines()[1:]
    assert len(rows) == 40
    for row, cells in enumerate(line.split(",") for line in rows):
        values = [float(cell) for cell in cells[:8]]
        joints = [float(joint.value(code)) for joint, code in zip(awkward.joints, awkward.codes[row], strict=True)]
        assert values == [*awkward.switches[row], *joints]


def test_weka_trains_on_it_with_the_last_attribute_as_class(
    weka: Callable[..., str], awkward: GraspSet, tmp_path: Path
) -> None:
    export(awkward, tmp_path / "table.arff")
    report = weka("weka.classifiers.rules.ZeroR", "-t", str(tmp_path / "table.arff"), "-no-cv")
    assert "ZeroR predicts class value: it's" in report
