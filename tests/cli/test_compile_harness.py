"""`thenar compile` for a harness, and the harness that it proposes."""

from dataclasses import replace
from pathlib import Path

from thenar.compiler import GraspSet
from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.scan_file import SCAN_NAME, load_scan
from thenar.runtime import Build
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.writing import harness_to_toml

from .conftest import refusal, thenar, works

FEW = ("--rounds", 3, "--folds", 0)


def test_a_proposed_harness_loads_and_reads_every_kept_switch_at_once(set_file: Path, tmp_path: Path) -> None:
    build, glove = tmp_path / "build", tmp_path / "glove.toml"
    done = works("compile", set_file, "-o", build, *FEW, "--propose", glove)
    assert f"{glove}: a harness for the kept switches; wire the glove so" in " ".join(done.stdout.split())
    assert not (build / SCAN_NAME).exists()
    harness = load_harness(glove)
    kept = tuple(switch.name for switch in Build.load(build).manifest.switches)
    assert (harness.name, harness.switches) == ("glove", kept)
    # Its joints are not called as a CyberGlove's.
    assert harness.cyberglove is None
    assert "need a source of your own" in " ".join(done.stdout.split())

    done = works("compile", set_file, "-o", build, *FEW, "--glove", glove)
    scan = load_scan(build, Build.load(build).manifest)
    assert scan is not None
    assert len(scan.ports) == 1
    assert "a whole scan: 1 transaction, 98.8 µs on the wire, 100.0 % of the 98.8 µs" in " ".join(done.stdout.split())
    assert thenar("verify", build, set_file).returncode == 0


def test_a_scan_is_told_with_its_share_of_the_wiring(set_file: Path, small_set: GraspSet, tmp_path: Path) -> None:
    names = [*small_set.switch_names, *(f"more {number}" for number in range(50))]
    glove = tmp_path / "full.toml"
    glove.write_text(harness_to_toml(propose_harness(names)))
    done = works("compile", set_file, "-o", tmp_path / "build", *FEW, "--glove", glove)
    assert "20.4 % of the 485.2 µs for all 56 wired switches" in " ".join(done.stdout.split())


def test_a_board_is_proposed_with_a_key_for_every_kept_switch(set_file: Path, tmp_path: Path) -> None:
    build, glove = tmp_path / "build", tmp_path / "glove.toml"
    works("compile", set_file, "-o", build, *FEW, "--propose", glove, "--chip", "board")
    harness = load_harness(glove)
    kept = tuple(switch.name for switch in Build.load(build).manifest.switches)
    assert [stream.switches for stream in harness.streams] == [kept]
    assert not harness.buses


def test_streams_are_told_with_their_switches(set_file: Path, small_set: GraspSet, tmp_path: Path) -> None:
    glove = tmp_path / "board.toml"
    names = ", ".join(f'"{name}"' for name in small_set.switch_names)
    glove.write_text(f'[[stream]]\nport = "/dev/ttyACM0"\nrate_hz = 200\nswitches = [{names}, "spare"]\n')
    done = works("compile", set_file, "-o", tmp_path / "build", *FEW, "--glove", glove)
    kept = len(Build.load(tmp_path / "build").manifest.switches)
    assert f"stream /dev/ttyACM0: {kept} kept switches, a row every 5000 µs" in " ".join(done.stdout.split())


def test_a_file_is_replaced_only_if_asked(set_file: Path, tmp_path: Path) -> None:
    glove = tmp_path / "glove.toml"
    glove.write_text("mine")
    given = ("compile", set_file, "-o", tmp_path / "build", *FEW, "--propose", glove, "--chip", "pcf8574")
    assert "already exists: add --overwrite" in " ".join(refusal(*given).split())
    assert glove.read_text() == "mine"
    assert not (tmp_path / "build").exists()
    assert thenar(*given, "--overwrite").returncode == 0
    assert load_harness(glove).buses[0].chips[0].kind == "pcf8574"


def test_options_that_do_not_go_together_are_refused(set_file: Path, tmp_path: Path) -> None:
    build, glove = ("compile", set_file, "-o", tmp_path / "build"), tmp_path / "glove.toml"
    glove.write_text("")
    refused = [
        (("--glove", glove, "--propose", tmp_path / "new.toml"), "give one of them"),
        (("--chip", "mcp23017"), "sets the chips of a proposed harness"),
        (
            ("--propose", tmp_path / "new.toml", "--chip", "mcp23018"),
            "there is no chip 'mcp23018'",
        ),
        (("--glove", tmp_path / "nowhere.toml"), "does not exist"),
    ]
    for options, words in refused:
        assert words in " ".join(refusal(*build, *options).split())
    assert not (tmp_path / "build").exists()


def test_compile_and_run_refuse_a_glove_that_lacks_a_joint(set_file: Path, small_set: GraspSet, tmp_path: Path) -> None:
    names = list(small_set.switch_names)
    columns = ", ".join(f'"{name}"' for name in ["ms", *names, "j0"])
    glove, build = tmp_path / "glove.toml", tmp_path / "build"
    glove.write_text(
        f'[[stream]]\nport = "-"\ncolumns = [{columns}]\ntime = "ms"\nrate_hz = 50\nswitches = {names}\n'
        "joints = { j0 = [0, 255] }\n"
    )
    said = refusal("compile", set_file, "-o", build, *FEW, "--no-report", "--glove", glove)
    assert "the build needs joint 'j1', and the glove has no sensor of that name" in said
    assert not build.exists()
    assert thenar("compile", set_file, "-o", build, *FEW, "--no-report").returncode == 0
    assert thenar("run", build, "--glove", glove, "--frames", 1).stderr == said
    fewer = thenar("compile", set_file, "-o", build, *FEW, "--no-report", "--glove", glove, "--inputs", "switches")
    assert (fewer.returncode, fewer.stderr) == (0, "")


def test_verify_run_and_segment_report_missing_inputs_alike(
    set_file: Path, small_set: GraspSet, tmp_path: Path
) -> None:
    build, other = tmp_path / "build", tmp_path / "other.grasps"
    assert thenar("compile", set_file, "-o", build, *FEW, "--no-report").returncode == 0
    kept = next(switch.name for switch in Build.load(build).manifest.switches)
    replace(
        small_set,
        switch_names=tuple("renamed" if name == kept else name for name in small_set.switch_names),
        joints=(small_set.joints[0], replace(small_set.joints[1], name="j_1")),
    ).save(other)
    said = refusal("verify", build, other)
    assert f"the recordings lack 2 inputs of the build: {kept}, j1" in said
    assert "with [rename] in the columns.toml for a column that has another name" in said
    for arguments in (("run", build, "--replay", other), ("segment", other, "-b", build)):
        done = thenar(*arguments)
        assert (done.returncode, done.stderr) == (2, said)
