import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ..conftest import tool


@pytest.mark.slow
def test_a_chip_of_another_package_is_proposed_specified_emulated_and_read(
    install: Callable[[str, str], Any], scene: Callable[[int], str], tmp_path: Path
) -> None:
    """One file of somebody else's: the chip is offered, wired, listed to buy, and answers on the emulated bus."""
    package = install("chip.py", "thenar.chips")
    grasps, build, glove, spec = (str(tmp_path / name) for name in ("set.grasps", "build", "glove.toml", "spec"))
    (tmp_path / "scene.toml").write_text(scene(3) + "[effects.contact.quasistatic]\n")
    package.thenar("simulate", str(tmp_path / "scene.toml"), "-o", grasps)
    chosen = ("--inputs", "switches", "--prune", "5", "--no-report")
    assert "tca6424a, tca9534; board" in " ".join(package.thenar("compile", "--help").split())
    package.thenar("compile", grasps, "-o", build, *chosen, "--propose", glove, "--chip", "tca9534")
    assert 'kind = "tca9534"' in Path(glove).read_text()

    package.thenar("spec", build, "--glove", glove, "-o", spec)
    bill = list(csv.DictReader(Path(spec, "bom.csv").read_text().splitlines()))
    kept = len(json.loads(Path(build, "build.json").read_text())["switches"])
    assert [row["maker"] for row in bill if row["part_number"] == "TCA9534PWR"] == ["Texas Instruments"]
    assert [row["quantity"] for row in bill if "without pull-ups" in row["note"]] == [str(kept)]

    tool("umockdev-wrapper")
    lines, log = tmp_path / "lines.jsonl", tmp_path / "played.jsonl"
    run = (sys.executable, "-P", "-m", "thenar.cli", "run", build, "--glove", "{glove}", "--sink", f"jsonl:{lines}")
    package.thenar(
        *("emulate", grasps, "--glove", glove, "--dir", str(tmp_path / "em"), "--period-ms", "100"),
        *("--log", str(log), "--", *run),
    )
    said = {json.loads(line)["grasp"] for line in lines.read_text().splitlines()}
    played = {json.loads(line)["grasp"] for line in log.read_text().splitlines()}
    assert len(said & played) > len(played) // 2
