import json
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet
from thenar.runtime.calibration import load_calibration
from thenar.runtime.harness.loading import load_harness

from .conftest import refusal, thenar, works

LONG_S = 60

SCENE = """
seed = 3
taxonomy = "kamakura14"
objects = "kamakura14"
repetitions = 1

[recording]
hold_ms = 20

[[subjects]]
name = "A"
hand_length_mm = 188
hand_breadth_mm = 84

[effects.contact.quasistatic]
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def glove(tmp_path: Path) -> Path:
    path = tmp_path / "glove.toml"
    path.write_text(
        '[cyberglove]\nport = "/dev/ttyUSB0"\n\n'
        '[[stream]]\nport = "/dev/ttyACM0"\nswitches = ["thumb_distal_1", "palm_heel_6"]\n[stream.board]\n'
    )
    return path


def test_emulate_runs_a_command_and_returns_its_exit_code(scene: Path, glove: Path, tmp_path: Path) -> None:
    folder, log = tmp_path / "em", tmp_path / "played.jsonl"
    program = "import os, sys; print(os.path.realpath(sys.argv[2])); sys.exit(7)"
    done = thenar(
        *("emulate", scene, "--glove", glove, "--dir", folder, "--log", log, "--repeat"),
        *("--", sys.executable, "-c", program, "{glove}", folder / "stream0"),
    )
    assert done.returncode == 7, done.stderr
    assert done.stdout.startswith("/dev/pts/")
    harness = load_harness(folder / "glove.toml")
    assert harness.cyberglove is not None
    assert harness.cyberglove.port == str(folder / "cyberglove")
    assert harness.streams[0].port == str(folder / "stream0")
    assert load_calibration(Path(str(harness.cyberglove.calibration))).subject == "A"
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert [line["row"] for line in lines[:14]] == list(range(len(lines[:14])))


def test_the_command_is_ended_when_all_is_played(scene: Path, glove: Path, tmp_path: Path) -> None:
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\ntry: signal.pause()\n"
    program += "except KeyboardInterrupt: print('ended')"
    done = thenar(
        *("emulate", scene, "--glove", glove, "--dir", tmp_path / "em", "--period-ms", 40),
        *("--", sys.executable, "-c", program),
    )
    assert (done.returncode, done.stdout) == (0, "ended\n"), done.stderr


def test_a_set_of_grasps_is_played_row_by_row(scene: Path, tmp_path: Path) -> None:
    made, glove, log = tmp_path / "set.grasps", tmp_path / "glove.toml", tmp_path / "log.jsonl"
    assert thenar("simulate", scene, "-o", made).returncode == 0
    grasp_set = GraspSet.load(made)
    glove.write_text(f'[[stream]]\nport = "x"\nswitches = {json.dumps(list(grasp_set.switch_names))}\n')
    works("emulate", made, "--glove", glove, "--dir", tmp_path / "em", "--period-ms", 2, "--log", log)
    assert [json.loads(line)["grasp"] for line in log.read_text().splitlines()] == grasp_set.grasps.tolist()


def test_between_grasps_the_hand_rests_and_the_log_says_none(scene: Path, glove: Path, tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    arguments = ("emulate", scene, "--glove", glove, "--dir", tmp_path / "em", "--period-ms", 4, "--rest-ms", 8)
    works(*arguments, "--log", log)
    grasps = [json.loads(line)["grasp"] for line in log.read_text().splitlines()]
    assert len(grasps) == 3 * 14
    assert "none" not in grasps[::3]
    assert set(grasps[1::3] + grasps[2::3]) == {"none"}


def test_ctrl_c_takes_the_ports_away_and_leaves_no_traceback(scene: Path, glove: Path, tmp_path: Path) -> None:
    folder = tmp_path / "em"
    arguments = ["emulate", scene, "--glove", glove, "--dir", folder, "--repeat"]
    command = [sys.executable, "-m", "thenar.cli", *map(str, arguments)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline().startswith("emulated glove: ")
        assert (folder / "cyberglove").is_symlink()
        process.send_signal(signal.SIGINT)
        _, complaint = process.communicate(timeout=LONG_S)
    assert process.returncode == 0
    assert "Traceback" not in complaint
    assert not (folder / "cyberglove").is_symlink()


def test_what_cannot_be_played_is_said(glove: Path, tmp_path: Path) -> None:
    (tmp_path / "run.mcap").touch()
    for arguments, reason in (
        ((tmp_path / "run.mcap", "--rest-ms", 8), "a recording has its rests: leave it out"),
        (("nosuch",), "no shipped scene is called 'nosuch'"),
        (("no.grasps",), "there is no file no.grasps"),
        (("quick", "--subject", "Z"), "has no subject 'Z'"),
    ):
        assert reason in refusal("emulate", *arguments, "--glove", glove, "--dir", tmp_path / "em")
    assert "no-such-program cannot be run" in refusal(
        "emulate", "quick", "--glove", glove, "--dir", tmp_path / "em", "--", "no-such-program"
    )


def test_nothing_that_it_reads_is_written_over(scene: Path, glove: Path, tmp_path: Path) -> None:
    before = glove.read_text()
    assert "glove.toml is named twice" in refusal("emulate", scene, "--glove", glove, "--dir", tmp_path)
    assert glove.read_text() == before
    done = thenar("emulate", scene, "--glove", glove, "--dir", tmp_path / "em", "--log", scene)
    assert done.returncode == 2
    assert scene.read_text() == SCENE


def test_a_command_ended_by_a_signal_gives_the_shells_exit_code(scene: Path, glove: Path, tmp_path: Path) -> None:
    program = "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"
    arguments = ("emulate", scene, "--glove", glove, "--dir", tmp_path / "em", "--repeat")
    assert thenar(*arguments, "--", sys.executable, "-c", program).returncode == 128 + signal.SIGTERM


def test_a_command_may_ask_for_keys(scene: Path, glove: Path, tmp_path: Path) -> None:
    arguments = ["emulate", scene, "--glove", glove, "--dir", tmp_path / "em", "--repeat"]
    program = "print('asked', flush=True); print('got', input())"
    command = [sys.executable, "-m", "thenar.cli", *map(str, arguments), "--", sys.executable, "-c", program]
    pid, terminal = pty.fork()
    if not pid:
        os.execv(command[0], command)
    said, answered = b"", False
    while chunk := _read(terminal):
        said += chunk
        if b"asked" in said and not answered:
            answered = os.write(terminal, b"a key\n") > 0
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0, said
    assert b"got a key" in said


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 65536)
    except OSError:  # everybody has left it
        return b""


def test_a_second_ctrl_c_leaves_no_command_behind(scene: Path, glove: Path, tmp_path: Path) -> None:
    arguments = ["emulate", scene, "--glove", glove, "--dir", tmp_path / "em", "--repeat"]
    program = "import signal\n"
    program += "def told(*_): print('told', flush=True)\n"
    program += "signal.signal(signal.SIGINT, told); print('begun', flush=True)\nwhile True: signal.pause()"
    command = [sys.executable, "-m", "thenar.cli", *map(str, arguments), "--", sys.executable, "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        for line in ("begun", "told"):
            assert process.stdout.readline().strip() == line
            process.send_signal(signal.SIGINT)
        # Ends only when the command, which holds it too, is gone.
        assert process.stdout.read() == ""
    assert process.returncode == 130


def test_a_switch_that_is_not_played_is_told(scene: Path, tmp_path: Path) -> None:
    path = tmp_path / "glove.toml"
    path.write_text('[[stream]]\nport = "/dev/ttyACM0"\nswitches = ["thumb_distal_1", "thumb_dorsal_1"]\n')
    done = works("emulate", scene, "--glove", path, "--dir", tmp_path / "em", "--", sys.executable, "-c", "pass")
    assert "has no switch thumb_dorsal_1: always open" in done.stderr


def test_a_harness_without_devices_is_not_emulated(scene: Path, tmp_path: Path) -> None:
    (tmp_path / "glove.toml").write_text("")
    assert "glove.toml names no device" in refusal(
        "emulate", scene, "--glove", tmp_path / "glove.toml", "--dir", tmp_path / "em"
    )
    assert not (tmp_path / "em").exists()


LEAVES_ONE_BEHIND = {
    "behind itself": "{python} -c {waits!r} & read line < {pipe}",
    "in a session of its own": "setsid {python} -c {waits!r} & wait $!",
    "deaf to what is polite": "{python} -c {deaf!r} & read line < {pipe}",
}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
@pytest.mark.parametrize("leaves", LEAVES_ONE_BEHIND.values(), ids=LEAVES_ONE_BEHIND)
def test_what_a_command_starts_ends_with_it(scene: Path, glove: Path, tmp_path: Path, leaves: str) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    waits = f"import pathlib, signal; pathlib.Path('{pipe}').write_text('begun\\n'); signal.pause()"
    deaf = waits.replace("pathlib.Path", "[signal.signal(n, signal.SIG_IGN) for n in (2, 15)]; pathlib.Path")
    client = leaves.format(python=sys.executable, waits=waits, deaf=deaf, pipe=pipe)
    arguments = ["emulate", scene, "--glove", glove, "--dir", tmp_path / "em", "--repeat", "--", "sh", "-c", client]
    command = [sys.executable, "-m", "thenar.cli", *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        if "read" not in leaves:
            assert pipe.read_text() == "begun\n"
            process.send_signal(signal.SIGINT)
        # Its stdout ends only when everybody who holds it is gone.
        assert process.communicate(timeout=LONG_S)[0] == ""


def test_a_glove_toml_of_the_users_is_replaced_only_if_asked(scene: Path, glove: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "glove.toml").write_text("mine")
    (folder / "notes.txt").write_text("mine")
    played = ("emulate", scene, "--glove", glove, "--dir", folder, "--period-ms", "1")
    assert "glove.toml already exists: add --overwrite" in refusal(*played)
    assert (folder / "glove.toml").read_text() == "mine"
    assert thenar(*played, "--overwrite").returncode == 0
    assert load_harness(folder / "glove.toml").cyberglove is not None
    assert (folder / "notes.txt").read_text() == "mine"


@pytest.mark.slow
def test_a_scene_with_taxels_is_recognised_live_from_a_board(tmp_path: Path) -> None:
    scene = tmp_path / "pads.toml"
    tables = '[glove]\ntaxels = ["thumb_distal", "index_distal", "middle_distal"]\n\n'
    tables += "[effects.taxel.noise]\n[effects.taxel.adc]\n"
    scene.write_text(SCENE.replace("repetitions = 1\n", "repetitions = 2\n") + tables)
    made, build, glove = tmp_path / "set.grasps", tmp_path / "build", tmp_path / "glove.toml"
    works("simulate", scene, "-o", made)
    training = ("--inputs", "switches", "--rounds", 20, "--folds", 0, "--no-report")
    grasp_set = GraspSet.load(made)
    pads = [column.name for column in grasp_set.taxel_columns]
    switches = [name for name in grasp_set.switch_names if name not in pads]
    glove.write_text(
        f'[[stream]]\nport = "tcp://board:1"\nrate_hz = 200\nswitches = {json.dumps(switches)}\n'
        f"taxels = {{ {', '.join(f'{name} = [0, 4095]' for name in pads)} }}\n[stream.board]\n"
    )
    works("compile", made, "-o", build, *training, "--glove", glove)
    log, grasps = tmp_path / "played.jsonl", tmp_path / "grasps.jsonl"
    works(
        *("emulate", scene, "--glove", glove, "--dir", tmp_path / "em", "--period-ms", 250, "--log", log, "--repeat"),
        *("--", sys.executable, "-m", "thenar.cli", "run", build, "--glove", "{glove}"),
        *("--sink", f"jsonl:{grasps}", "--frames", 500),
    )
    played = [json.loads(line) for line in log.read_text().splitlines()]
    times = [row["time_us"] for row in played]
    rows, right = set[int](), []
    for line in map(json.loads, grasps.read_text().splitlines()):
        row = int(np.searchsorted(times, line["time_us"])) - 1
        # A tenth of a second after a change everything has arrived; without health no grasp is announced.
        if line["kind"] == "grasp" and line["health"] == "ok" and row >= 0 and line["time_us"] > times[row] + 100_000:
            right.append(line["grasp"] == played[row]["grasp"])
            rows.add(row)
    assert len(rows) >= 4
    assert np.mean(right) > 0.9
