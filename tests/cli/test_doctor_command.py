import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.drivers.emulated.cyberglove import Doubts, EmulatedCyberGlove
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.live import checkup, stream_probe

from .conftest import refusal, thenar, works

NAMES = ["j0", "j1", *SENSORS_18[2:]]


@pytest.fixture
def glove(tmp_path: Path) -> Iterator[EmulatedCyberGlove]:
    with PtyLine(tmp_path / "port") as line, EmulatedCyberGlove(line) as glove:
        yield glove


@pytest.fixture
def harness(tmp_path: Path, glove: EmulatedCyberGlove, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(checkup, "_LISTEN_S", 0.3)  # nearly fifty records
    path = tmp_path / "glove.toml"
    path.write_text(f'[cyberglove]\nport = "{tmp_path}/port"\njoints = {NAMES}\n')
    return path


def calibrated(harness: Path, *joints: str) -> None:
    lines = tuple(SensorCalibration(joint, 1, 0.0, 255, 90.0) for joint in joints)
    harness.with_name("anna.toml").write_text(GloveCalibration(sensors=lines, subject="anna").to_toml())
    harness.write_text(harness.read_text() + 'calibration = "anna.toml"\n')


def test_doctor_measures_records_as_fast_as_they_come_against_the_formula(harness: Path) -> None:
    harness.write_text(harness.read_text() + "rate_hz = 10\n")
    done = works("doctor", harness, "--json")
    (found,) = json.loads(done.stdout)
    assert found["present"]
    assert round(found["predicted_us"]) == 6323
    assert 0.9 * found["predicted_us"] < found["measured_us"] < 2 * found["predicted_us"]
    assert found["part"] == "CyberGlove, emulated"


def test_a_box_without_a_mask_is_found(
    small_set: GraspSet, harness: Path, glove: EmulatedCyberGlove, tmp_path: Path
) -> None:
    build = compile_build(small_set, tmp_path / "build", rounds=5, folds=0, inputs="joints").folder
    calibrated(harness, "j0", "j1")
    glove.box.doubts = Doubts(mask="ignored")
    done = works("doctor", harness, "--build", build)
    assert "it accepts no sensor mask" in " ".join(done.stdout.split())


def test_a_port_that_is_not_there_is_exit_code_1(tmp_path: Path) -> None:
    path = tmp_path / "glove.toml"
    path.write_text('[cyberglove]\nport = "/dev/none"\n')
    done = thenar("doctor", path)
    assert done.returncode == 1
    assert "/dev/none: there is no such port" in done.stdout
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("table", ["[cyberglove]\nport = {}", "[[stream]]\nswitches = ['s']\nport = {}"])
def test_a_port_that_writes_to_a_file_is_refused(tmp_path: Path, table: str) -> None:
    path, victim = tmp_path / "glove.toml", tmp_path / "victim"
    victim.write_text("kept")
    path.write_text(table.format(f'"spy:///dev/null?file={victim}"'))
    assert "port: 'spy:///dev/null?file=" in refusal("doctor", path)
    path.write_text(table.format(f'"{victim}"'))
    assert thenar("doctor", path).returncode == 1
    assert victim.read_text() == "kept"


def test_a_calibration_that_cannot_be_read_is_found(harness: Path) -> None:
    harness.write_text(harness.read_text() + 'calibration = "anna.toml"\n')
    done = thenar("doctor", harness)
    assert done.returncode == 1
    assert "anna.toml: cannot be read" in done.stdout


def test_what_a_build_needs_of_the_calibration_is_found(small_set: GraspSet, harness: Path, tmp_path: Path) -> None:
    build = compile_build(small_set, tmp_path / "build", rounds=5, folds=0, inputs="joints").folder
    assert thenar("doctor", harness).returncode == 0
    done = thenar("doctor", harness, "--build", build)
    assert done.returncode == 1
    assert "calibrate it (`thenar calibrate`)" in done.stdout
    calibrated(harness, "j0", "j1")
    works("doctor", harness, "--build", build)


def test_a_harness_without_devices_is_refused(tmp_path: Path) -> None:
    (tmp_path / "glove.toml").write_text("")
    assert "glove.toml names no device" in refusal("doctor", tmp_path / "glove.toml")


@pytest.mark.usefixtures("glove")
def test_the_proposal_for_a_cyberglove_is_one_that_doctor_accepts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkup, "_LISTEN_S", 0.3)
    line, proposal = f"cyberglove:{tmp_path}/port", tmp_path / "found.toml"
    listening = ("doctor", "--line", line, "--seconds", "0.5", "--names")
    assert "2 columns are named, but rows have 18" in refusal(*listening, "a,b")
    found = json.loads(works(*listening, ",".join(NAMES), "--json", "--propose", proposal).stdout)
    assert [one["column"] for one in found["columns"]] == NAMES
    assert "did not move: press every pad and bend every finger" in " ".join(found["remarks"])
    works("doctor", proposal)


@pytest.mark.usefixtures("glove")
def test_silence_on_a_serial_port_hints_at_a_cyberglove(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_probe, "_PATIENCE_US", 500_000)
    said = refusal("doctor", "--line", f"{tmp_path}/port", "--seconds", "0.5")
    assert f"if it is a CyberGlove, write cyberglove:{tmp_path}/port" in said
