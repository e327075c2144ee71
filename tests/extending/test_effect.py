"""An effect of somebody else's: simulated where a scene lists it, and not even imported elsewhere."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import GraspSet

SECOND = """
[[subjects]]
name = "B"
hand_length_mm = 181
hand_breadth_mm = 81
"""
LISTED = "[effects.joint.offset]\nsd_deg = 6\n"


@pytest.fixture
def scenes(scene: Callable[[int], str], tmp_path: Path) -> tuple[Path, Path]:
    """Files of two scenes, of which the second lists the effect."""
    plain, off = tmp_path / "plain.toml", tmp_path / "off.toml"
    plain.write_text(scene(2) + SECOND)
    off.write_text(plain.read_text() + LISTED)
    return plain, off


@pytest.mark.slow
def test_a_foreign_effect_acts_where_it_is_listed(install: Callable[..., Any], scenes: tuple[Path, Path]) -> None:
    package = install("effect.py", "thenar.effects", "joint.offset")
    plain, off = scenes
    one, other = (GraspSet.load(simulated(package, scene)) for scene in (plain, off))
    assert np.array_equal(one.switches, other.switches)
    for subject in "AB":
        moved = (other.codes.astype(int) - one.codes)[one.subjects == subject]
        assert (np.ptp(moved, axis=0) <= 4).all()  # counts of half a degree, of bytes of up to 1.6 degrees
        assert np.abs(moved.mean(axis=0)).max() > 6


def simulated(package: Any, scene: Path) -> Path:
    written = scene.with_suffix(".grasps")
    said = package.thenar("simulate", str(scene), "-o", str(written), "--jobs", "2", "--json")
    assert ("joint.offset" in said) == (LISTED in scene.read_text())
    return written


def test_one_that_cannot_be_loaded_disturbs_only_scenes_that_list_it(
    install: Callable[..., Any], scenes: tuple[Path, Path]
) -> None:
    package = install("effect.py", "thenar.effects", "joint.offset")
    (package.folder / "somebody_elses_effect.py").write_text("raise RuntimeError('no such glove')\n")
    plain, off = scenes
    simulated(package, plain)
    said = package.thenar("simulate", str(off), "-o", str(off.with_suffix(".grasps")), code=2)
    assert "the effect 'joint.offset' (somebody_elses_effect:MEMBER) of another package cannot be loaded" in said
