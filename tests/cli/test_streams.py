"""A glove that sends lines, from `thenar doctor --line` to `thenar run`, by every way that lines come."""

import contextlib
import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path
from threading import Event
from time import monotonic

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.graspset import Joint
from thenar.drivers.emulated.lines import BoardSender, DatagramLines, LineSender, LineServer
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime import Build
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.live import checkup
from thenar.runtime.live.replay import replayed

from ..sending import sending
from ..sets import grasp_set_of
from .conftest import refusal, thenar, works

STREAM = """name = "maker"
[[stream]]
port = "{port}"
columns = ["ms", "s0", "s1", "s2", "s3", "s4", "s5", "j0", "j1"]
time = "ms"
rate_hz = 100
switches = ["s0", "s1", "s2", "s3", "s4", "s5"]
joints = {joints}
"""
PORTS = [
    "/dev/ttyUSB0",
    "tcp://glove.local:3333",
    "udp://0.0.0.0:3333",
    "-",
]


def test_names_that_the_sender_gives_say_what_columns_are(tmp_path: Path) -> None:
    rows = "".join(
        json.dumps(
            {"t_ms": 20 * n, "fsr_palm": 80 * (n % 7), "flex_ring": 100 + 20 * (n % 9), "thumb": n % 2, "off": None}
        )
        + "\nboot it\n"
        for n in range(30)
    )
    done = subprocess.run(
        [sys.executable, "-m", "thenar.cli", "doctor", "--line", "-", "--seconds", "0.5", "--json"],
        input=rows, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert {one["column"]: one["taken_for"] for one in found["columns"]} == {
        "t_ms": "the sender's clock, in ms",
        "fsr_palm": "taxel",
        "flex_ring": "joint",
        "thumb": "switch",
        "off": "nothing: no number came",
    }
    assert found["harness"]["stream"][0]["rate_hz"] == 50
    assert [text.split(", ")[0] for text in found["remarks"]] == [
        "30 lines were not rows",
        "the rows came all at once: rate_hz is by their clock",
        "off: 30 of 30 values were not numbers",
    ]


def listened(rows: str, *options: str) -> "subprocess.CompletedProcess[str]":
    """Run `thenar doctor --line -` on these lines, after which its standard input ends."""
    command = [sys.executable, "-m", "thenar.cli", "doctor", "--line", "-", *options]
    return subprocess.run(command, input=rows, capture_output=True, text=True, check=False)


def test_columns_that_did_not_move_are_said_and_get_no_range() -> None:
    header = "ms,thumb,index,fsr_palm,fsr_tip,flex_mcp,flex_pip\n"
    rows = (f"{20 * n},{n % 2},0,{90 + n % 3},{90 + 99 * (n % 7)},512,{512 + 99 * (n % 5)}\n" for n in range(99))
    found = json.loads(listened(header + "".join(rows), "--json").stdout)
    still = ["index", "fsr_palm", "flex_mcp"]
    assert [one["column"] for one in found["columns"] if one["taken_for"] == "nothing: it did not move"] == still
    stream = found["harness"]["stream"][0]
    assert (stream["switches"], list(stream["taxels"]), list(stream["joints"])) == (
        ["thumb"],
        ["fsr_tip"],
        ["flex_pip"],
    )
    said = "index, fsr_palm, flex_mcp did not move: press every pad and bend every finger meanwhile"
    assert said in found["remarks"]


def test_a_table_with_labels_and_coarse_times_proposes_a_valid_harness(tmp_path: Path) -> None:
    path = tmp_path / "glove.toml"
    header = "time,ms,thumb,flex,weight,label\n"
    rows = (
        f"{1_700_000_000 + n // 50},{20 * n},{n % 2},{9 * n},{123456.7 + 9e4 * (n % 2)},{'fist' if n % 9 else 'open'}\n"
        for n in range(99)
    )
    done = listened(header + "".join(rows), "--propose", str(path))
    assert done.returncode == 0, done.stderr
    stream = load_harness(path).streams[0]
    assert (stream.columns, stream.time) == (("", "ms", "thumb", "", "weight", ""), "ms")
    low, high = stream.taxels["weight"]
    assert low < 123456.7 < high


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("0x3f,0x0g", "no rows: '0x3f,0x0g'; a row is numbers with commas between, name:value, or JSON"),
        ("10:00:00.125 -> 1,0", "the data holds no rows: '10:00:00.125 -> 1,0'; a row is numbers"),
        ("5,1,fist", "--names says how many columns rows with texts have"),
        ("7" * 20_000, "its lines are longer than any row"),
        ("A2000B1990A2047", "the data holds no rows: 'A2000B1990A2047'"),
        ("A2000,B1990,C2047", "the data holds no rows: 'A2000,B1990,C2047'"),
        ("", "9 bytes came, but no line: end each row with a line feed"),
        ('{"fingers": {"thumb": 1}}', "no column is a switch, a joint or a taxel, so no glove.toml is proposed"),
    ],
)
def test_unusable_lines_are_shown_and_no_file_is_written(line: str, said: str, tmp_path: Path) -> None:
    done = listened(f"{line}\n" * 9, "--propose", str(tmp_path / "glove.toml"))
    assert done.returncode
    assert said in " ".join(done.stderr.split())
    assert "baud" not in done.stderr
    assert not any(tmp_path.iterdir())


def test_column_names_are_stripped_and_checked_unless_the_sender_names_them() -> None:
    rows = "".join(f"{20 * n},{n % 2}\n" for n in range(30))
    found = json.loads(listened(rows, "--names", "ms, thumb", "--json").stdout)
    assert found["harness"]["stream"][0]["columns"] == ["ms", "thumb"]
    done = listened(rows, "--names", "thumb,thumb")
    assert (done.returncode, "--names names a column twice: thumb, thumb" in done.stderr) == (2, True)
    done = listened(rows, "--names", "ms,thumb,index")
    assert (done.returncode, "3 columns are named, but rows have 2" in done.stderr) == (2, True)
    found = json.loads(listened(f"t_ms,index\n{rows}", "--names", "ms,thumb", "--json").stdout)
    assert found["harness"]["stream"][0]["columns"] == ["t_ms", "index"]
    assert "the sender names its columns itself, so --names is not used" in found["remarks"]


def test_doctor_reports_two_senders(tmp_path: Path) -> None:
    path = tmp_path / "glove.toml"
    with DatagramLines() as first, DatagramLines() as second:
        second.to = first.to

        def send(n: int) -> None:
            first.send(b"%d,%d,%d" % (10 * n, n % 2, 40 * (n % 9)))
            second.send(b"%d,1,7" % (10 * n))

        asked = ("--baud", "9600", "--seconds", "2", "--propose", path, "--json")
        with sending(send):
            found = thenar("doctor", "--line", first.port, *asked)
    assert found.returncode == 0, found.stderr
    remarks = "\n".join(json.loads(found.stdout)["remarks"])
    for said in (
        r"127.0.0.1:\d+ sends, too, and its lines are left out",
        r"\d+ rows of another sender",
    ):
        assert re.search(said, remarks), remarks
    assert load_harness(path).streams[0].baud == 115_200


@pytest.mark.parametrize(
    ("rate_hz", "line", "said"),
    [
        (20, "{ms},0,1,0,1,0,1,60,35", "rows a second arrive, but glove.toml says 20: set rate_hz = "),
        (90, "ms,s0,s1,s2,s3,s4,s5,j0,k1\n{ms},0,1,0,1,0,1,60,35", "its rows lack j1: name columns in glove.toml as"),
        (
            90,
            "ms,t0,t1,t2,t3,t4,t5,k0,k1\n{ms},0,1,0,1,0,1,60,35",
            "its rows have other columns than glove.toml: ms, t0",
        ),
        (90, "{ms},0,1,0,1,0,1,60,35\n{late},0,1,0,1,0,1,60,35", "rows come after later ones and are left out"),
        (90, "{ms},0,1,0,1,0,1,60,35\n{other},0,1,0,1,0,1,60,35", "rows of another clock come and are left out"),
        (90, "A512,B300,C200", "the data holds no rows: 'A512,B300,C200'"),
    ],
)
def test_doctor_says_what_is_wrong_with_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rate_hz: int, line: str, said: str
) -> None:
    monkeypatch.setattr(checkup, "_STARTS_S", 0.0)  # no board is reset here
    path, began = tmp_path / "glove.toml", monotonic()
    with LineServer() as lines:
        text = STREAM.format(port=lines.port, joints="{ j0 = [0, 127.5], j1 = [0, 127.5] }")
        path.write_text(text.replace("rate_hz = 100", f"rate_hz = {rate_hz}"))

        def send(_number: int) -> None:
            ms = round(1000 * (monotonic() - began))
            lines.send(line.format(ms=ms, late=ms - 50, other=ms + 60_000).encode() + b"\n")

        with sending(send):
            found = thenar("doctor", path, "--json")
    assert said in json.loads(found.stdout)[0]["remarks"][0]


@pytest.mark.slow
def test_rows_that_had_been_waiting_do_not_count_for_the_rate(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "thenar.cli", "doctor", "--line", "-", "--seconds", "2", "--json"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        descriptor = process.stdin.fileno()
        os.write(descriptor, b"".join(b"%d,%d\n" % (n * 0.1, n % 2) for n in range(600)))

        def send(line: bytes) -> None:
            with contextlib.suppress(BrokenPipeError):
                os.write(descriptor, line)

        with LineSender(send, ("ms", "thumb"), 100, "ms", "ms"):
            assert process.wait(60) == 0
        assert process.stdout is not None
        found = json.loads(process.stdout.read())
    assert 0 < found["harness"]["stream"][0]["rate_hz"] <= 110


def test_a_line_where_nothing_comes_or_nothing_can_is_said(tmp_path: Path) -> None:
    for port, said in (
        ("spy://x", "is not a supported port"),
        ("/dev/none", "there is no such port"),
    ):
        assert said in refusal("doctor", "--line", port)
    assert "nothing to check: name a glove.toml, or a port" in thenar("doctor").stderr


def right(log: Path, lines: Path) -> float:
    """Return the share of moments in which what was played, for 50 ms at least, was recognised."""
    played = [json.loads(line) for line in log.read_text().splitlines()]
    times = np.array([one["time_us"] for one in played])
    found = []
    for grasp in map(json.loads, lines.read_text().splitlines()):
        at = int(np.searchsorted(times, grasp["time_us"])) - 1
        if at >= 0 and grasp["time_us"] - times[at] > 50_000 and grasp["health"] != "unknown":
            found.append(grasp["candidate"] == played[at]["grasp"])
    assert len(found) > 20
    return float(np.mean(found))


@pytest.mark.slow
@pytest.mark.parametrize("port", PORTS)
def test_an_emulated_sender_is_recognised_by_every_way_and_replays_alike(
    build_folder: Path, set_file: Path, tmp_path: Path, port: str
) -> None:
    (tmp_path / "mine.toml").write_text(STREAM.format(port=port, joints="{ j0 = [0, 127.5], j1 = [127.5, 0] }"))
    out, log, recording = tmp_path / "out.jsonl", tmp_path / "log.jsonl", tmp_path / "run.mcap"
    command = [sys.executable, "-m", "thenar.cli", "run", build_folder, "--glove", "{glove}"]
    command += ["--frames", "150", "--sink", f"jsonl:{out}?every", "--record", recording]
    works(
        *("emulate", set_file, "--glove", tmp_path / "mine.toml", "--dir", tmp_path / "emulated"),
        *("--period-ms", "150", "--repeat", "--log", log, "--", *command),
    )
    assert right(log, out) >= 0.9
    again = list(replayed(Build.load(build_folder), recording))
    assert [now.grasp for _, now in again] == [then for then, _ in again]


@pytest.mark.slow
@pytest.mark.parametrize("inputs", ["both", "switches", "joints"])
def test_a_board_printing_kept_elements_only_is_recognised_and_recorded(
    small_set: GraspSet, tmp_path: Path, inputs: str
) -> None:
    folder = compile_build(small_set, tmp_path / "build", rounds=5, folds=0, inputs=inputs).folder
    build = Build.load(folder)
    switches = tuple(switch.name for switch in build.manifest.switches)
    joints = tuple(joint.name for joint in build.manifest.joints)
    port, recording = tmp_path / "port", tmp_path / "run.mcap"
    (tmp_path / "glove.toml").write_text(
        f'[[stream]]\nport = "{port}"\nrate_hz = 100\nswitches = {[f"s{number}" for number in range(30)]}\n'
        f"joints = {{ {', '.join(f'j{number} = [0, 127]' for number in range(9))} }}\n"
        "taxels = { p0 = [0, 1023] }\n[stream.board]\n"
    )
    with PtyLine(port) as line, BoardSender(line.send, switches, joints, 100) as board:
        board.show(dict.fromkeys(joints, 64.0))
        run = ("run", folder, "--glove", tmp_path / "glove.toml", "--frames", 300, "--record", recording)
        done = thenar(*run, "--status", "--sink", "jsonl:-?every")
    assert done.returncode == 0, done.stderr
    found = [line for line in map(json.loads, done.stdout.splitlines()) if line["kind"] == "grasp"]
    # Its columns are named once a second.
    assert sum(grasp["health"] in ("ok", "changing") for grasp in found) > 150
    assert not any(grasp["lost"] for grasp in found[-100:])
    assert "rows lack" not in done.stderr
    again = list(replayed(build, recording))
    assert [now.grasp for _, now in again] == [then for then, _ in again]


def counted_of_one_answer(lines: Path) -> tuple[dict[str, int], str]:
    """Hold that all is one answer where all is well; return what the only device has counted, and its error."""
    found = [json.loads(line) for line in lines.read_text().splitlines()]
    well = [one for one in found if one["kind"] == "grasp" and one["health"] == "ok"]
    assert (len({one["grasp"] for one in well}), len({one["candidate"] for one in well})) == (1, 1)
    (device,) = [one for one in found if one["kind"] == "health"][-1]["devices"]
    return {count["name"]: count["value"] for count in device["counts"]}, device["error"]


@pytest.mark.slow
def test_a_broken_sender_spoils_no_answer_and_is_counted(build_folder: Path, tmp_path: Path) -> None:
    odd = [
        b"\xff\xfe\x00\n",
        b"1,2\n",
        b'{"ms": \n',
        b"8" * 200_000 + b"\n",
        b"[" * 9000 + b"\n",
        b"ms,s0\n",
        b"nan\n" * 9,
    ]
    out, began = tmp_path / "out.jsonl", monotonic()
    said = '[[stream]]\nrate_hz = 50\nswitches = ["s0", "s1", "s2", "s3", "s4", "s5"]\n'
    said += 'joints = { j0 = [0, 127.5], j1 = [0, 127.5] }\ntime = "ms"\n'
    with LineServer() as lines:
        (tmp_path / "mine.toml").write_text(f'{said}port = "{lines.port}"\n')
        values = {f"s{number}": number % 2 for number in range(6)} | {"j0": 60.0, "j1": 35.0}

        def send(_number: int) -> None:
            now = round(1000 * (monotonic() - began))
            lines.send(json.dumps({"ms": now} | values).encode() + b"\n" + odd[now % len(odd)])
            lines.send(json.dumps({"ms": now - 50} | values).encode() + b"\n")

        command = ["run", build_folder, "--glove", tmp_path / "mine.toml", "--frames", "150", "--status"]
        with sending(send, 0.015):
            finished = thenar(*command, "--sink", f"jsonl:{out}?every")
    assert finished.returncode == 0, finished.stderr
    counts, _ = counted_of_one_answer(out)
    assert min(counts[name] for name in ("rows", "late", "misfits", "overlong", "wrong columns")) > 0
    assert counts["program faults"] == counts["restarts"] == 0


@pytest.mark.slow
def test_joints_alone_of_bytes_are_recognised_as_they_were_recorded(tmp_path: Path) -> None:
    high = {"cup": (200, 30), "pen": (30, 200), "rod": (200, 200)}
    labels = np.arange(60) % 3
    joints = tuple(Joint(f"flex_{number}", "raw", 1, 1.0, 255, 255.0) for number in (1, 2))
    recorded = grasp_set_of(list(high), labels, codes=np.array(list(high.values()))[labels], joints=joints)
    recorded.save(tmp_path / "set.grasps")
    build = compile_build(recorded, tmp_path / "build", rounds=10, folds=0, inputs="joints").folder
    (tmp_path / "mine.toml").write_text(
        '[[stream]]\nport = "udp://0.0.0.0:1"\nrate_hz = 100\n'
        "joints = { flex_1 = [0, 4095], flex_2 = [3000, 10] }\n"
        'columns = ["flex_1", "flex_2"]\n'
    )
    out, log = tmp_path / "out.jsonl", tmp_path / "log.jsonl"
    command = [sys.executable, "-m", "thenar.cli", "run", build, "--glove", "{glove}", "--frames", "100"]
    works(
        *("emulate", tmp_path / "set.grasps", "--glove", tmp_path / "mine.toml", "--dir", tmp_path / "emulated"),
        *("--period-ms", "150", "--repeat", "--log", log, "--", *command, "--sink", f"jsonl:{out}?every"),
    )
    assert right(log, out) == 1.0


@pytest.mark.parametrize("options", [(), ("--taxels",)])
def test_calibrate_refuses_rows_from_stdin_where_the_user_types(tmp_path: Path, options: tuple[str, ...]) -> None:
    path = tmp_path / "glove.toml"
    path.write_text('[[stream]]\nport = "-"\njoints = { flex = [0, 9] }\ntaxels = { pad = [0, 9] }\n')
    assert "the keys that lead a calibration come from stdin: send rows by udp: instead" in refusal(
        "calibrate", path, "-o", tmp_path / "anna.toml", *options
    )


@pytest.mark.slow
def test_calibrate_asks_for_the_joints_of_a_stream(tmp_path: Path) -> None:
    path, out = tmp_path / "glove.toml", tmp_path / "anna.toml"
    with LineServer() as lines, LineSender(lines.send, ("flex",), 100, None, "ms") as sender:
        path.write_text(f'[[stream]]\nport = "{lines.port}"\njoints = {{ flex = [0, 1000] }}\ncolumns = ["flex"]\n')
        master, slave = pty.openpty()
        command = [sys.executable, "-m", "thenar.cli", "calibrate", str(path), "-o", str(out), "--hold", "0.1"]
        with subprocess.Popen(command, stdin=slave, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            assert process.stderr is not None
            for value in (100.0, 700.0):
                while b"Enter" not in process.stderr.readline():
                    pass
                sender.show({"flex": value})
                Event().wait(0.05)
                os.write(master, b"\n")
            assert process.wait(20) == 0
    os.close(slave)
    os.close(master)
    text = out.read_text()
    assert "raw_a = 26" in text
    assert "value_b = 90.0" in text
