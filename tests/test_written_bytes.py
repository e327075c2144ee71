"""What the commands write keeps its bytes: digests of sets, builds, firmware and recordings, kept in tests/golden.

A change of one of them is a change of what users store and deploy. `pytest --update-golden` writes them anew; the
commit says why.
"""

import hashlib
import json
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from thenar.cli import run
from thenar.compiler import GraspSet, place
from thenar.compiler.glove.propose import propose_cyberglove, propose_harness
from thenar.runtime import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording import writer
from thenar.runtime.recording.session import Session

GOLDEN = Path(__file__).parent / "golden" / "written-bytes.json"
COLUMNS = Path(__file__).resolve().parents[1] / "examples" / "columns"
SCENES = ("quick", "kamakura", "kamakura-def", "cutkosky", "cutkosky-def", "continuous", "faulty-glove", "crowd")
FEWER = {"crowd": ["--subjects", "4", "--repetitions", "6"]}  # of a hundred hands


def digests(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the path below `folder` and the SHA-256 of every file in it, in order."""
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        yield path.relative_to(folder).as_posix(), hashlib.sha256(path.read_bytes()).hexdigest()


def kept(name: str, written: dict[str, str], update: bool) -> None:
    golden = json.loads(GOLDEN.read_text())
    if update:  # not with -n: each worker would write its own
        GOLDEN.write_text(json.dumps(golden | {name: written}, indent=1, sort_keys=True) + "\n")
    else:
        assert written == golden[name]


def digest(written: object) -> str:
    return hashlib.sha256(json.dumps(written, sort_keys=True).encode()).hexdigest()


def contents(build: Path) -> Iterator[tuple[str, str]]:
    """Yield each file of a build and its digest; of its firmware, of which a folder stands in golden/firmware, one."""
    yield from ((f"{build.name}/{name}", found) for name, found in digests(build) if not name.startswith("firmware/"))
    yield f"{build.name}/firmware", digest(dict(digests(build / "firmware")))


def builds_of(grasps: Path, glove: Path, folder: Path) -> dict[str, str]:
    """Compile `grasps` with sums of 16 bits and a wiring, and lines of 8 bits; return the digests."""
    whole, small = folder / "whole", folder / "small"
    common = ["compile", str(grasps), "--folds", "0", "--no-report"]
    assert run([*common, "-o", str(whole), "--glove", str(glove), "--rounds", "10"]) == 0
    assert run([*common, "-o", str(small), "--trainer", "linear", "--table-bits", "8"]) == 0
    found = {"set.grasps": hashlib.sha256(grasps.read_bytes()).hexdigest()}
    return found | dict(contents(whole)) | dict(contents(small))


def results_of(grasps: Path, glove: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    """Evaluate and compile `grasps`, replay the build, and specify its glove; return digests of what was written."""
    build, spec = folder / "build", folder / "spec"
    common = ["compile", str(grasps), "--folds", "0", "--no-report", "--trainer", "logit"]
    assert run([*common, "-o", str(build), "--glove", str(glove)]) == 0
    if Build.load(build).manifest.switches:
        assert run(["spec", str(build), "--glove", str(glove), "-o", str(spec)]) == 0
    capsys.readouterr()
    assert run(["run", str(build), "--replay", str(grasps)]) == 0
    replay = capsys.readouterr().out
    limits = ["--repeats", "1", "--folds", "3", "--trainer", "logit", "--tables", "compositions"]
    assert run(["evaluate", str(grasps), *limits, "-o", str(folder / "evaluation.json")]) == 0
    evaluation = json.loads((folder / "evaluation.json").read_text())
    del evaluation["options"]  # what was asked for, above
    return {"replay": digest(replay), "evaluation.json": digest(evaluation)} | {
        f"spec/{name}": digest for name, digest in digests(spec)
    }


@pytest.fixture(scope="module")
def set_of(tmp_path_factory: pytest.TempPathFactory, icub_table: Path, aml_table: Path) -> Callable[[str], Path]:
    """Return what makes the set of a shipped scene or of a real table, once."""
    tables = {"icub": icub_table, "aml": aml_table}

    @cache
    def made(name: str) -> Path:
        grasps = tmp_path_factory.mktemp("set") / "set.grasps"
        if name in tables:
            columns = str(COLUMNS / f"{name}.toml")
            assert run(["import", str(tables[name]), "-o", str(grasps), "--columns", columns]) == 0
        else:
            assert run(["simulate", name, *FEWER.get(name, []), "-o", str(grasps)]) == 0
        return grasps

    return made


@pytest.fixture(scope="module")
def glove_for(set_of: Callable[[str], Path]) -> Callable[[str], Path]:
    """Return what proposes a glove for a set, as `compile --propose` does, once: it follows from the placement."""

    @cache
    def proposed(name: str) -> Path:
        grasp_set, path = GraspSet.load(set_of(name)), set_of(name).with_name("glove.toml")
        joints = propose_cyberglove(grasp_set.joint_names)
        names = place(grasp_set).names if grasp_set.element_names else ()
        glove = propose_harness(names, name="glove", cyberglove=joints)
        path.write_text(harness_to_toml(glove))
        return path

    return proposed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quick", "kamakura", "cutkosky", "icub", "aml"])
def test_a_set_gives_the_same_results(
    tmp_path: Path,
    set_of: Callable[[str], Path],
    glove_for: Callable[[str], Path],
    name: str,
    update_golden: bool,
    capsys: pytest.CaptureFixture[str],
) -> None:
    kept(f"{name}: results", results_of(set_of(name), glove_for(name), tmp_path, capsys), update_golden)


@pytest.mark.slow
def test_a_search_finds_the_same_accuracies(tmp_path: Path, set_of: Callable[[str], Path], update_golden: bool) -> None:
    """Times are the machine's: only the accuracies of placements as they were screened are the same everywhere."""
    name = "icub"
    limits = ["--trainer", "logit", "--repeats", "1", "--finalists", "1"]
    assert run(["frontier", str(set_of(name)), "-o", str(tmp_path / "frontier"), *limits]) == 0
    screened: dict[str, dict[str, object]] = {}
    for tried in json.loads((tmp_path / "frontier" / "frontier.json").read_text())["tried"]:
        method, parameter = tried["placement"].values()
        if "keep_joints" not in tried:
            # The first of its kind; a finalist comes after.
            place = f"{parameter} {tried['inputs']}"
            screened.setdefault(method, {}).setdefault(place, [tried["n_switches"], tried["rate"]["correct"]])
    kept(f"{name}: screened", {method: digest(found) for method, found in screened.items()}, update_golden)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SCENES, "icub", "aml"])
def test_a_set_gives_the_same_builds(
    tmp_path: Path, set_of: Callable[[str], Path], glove_for: Callable[[str], Path], name: str, update_golden: bool
) -> None:
    kept(name, builds_of(set_of(name), glove_for(name), tmp_path), update_golden)


def test_a_recording_keeps_its_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, update_golden: bool) -> None:
    monkeypatch.setattr(time, "time_ns", lambda: 10**18)
    monkeypatch.setattr(time, "monotonic_ns", lambda: 10**15)
    path = tmp_path / "run.mcap"
    glove = GloveFrame(20, b"\x01\xff", 3)
    with writer.Recorder(path, Session(thenar="0.0.1", switches=("a", "b"), sensors=("thumb", "index"))) as recorder:
        recorder.frame(SwitchFrame(10, 0b10, lost=0b1))
        recorder.frame(glove)
        recorder.frame(SwitchFrame(25, 0b1, glove=glove))
        recorder.moment((), LiveGrasp(30, 1, 0, "cup", "cup", 0.75, 3, "ok", 30, 20, 10))
    kept("recording", {path.name: hashlib.sha256(path.read_bytes()).hexdigest()}, update_golden)
