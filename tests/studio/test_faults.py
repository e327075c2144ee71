"""The studio while its project changes under it, and while the glove is used by several pages."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from websockets.sync.client import ClientConnection

from thenar.cli import run
from thenar.compiler import compile_build
from thenar.compiler.hand import HandShape
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.drivers.errors import SettingError
from thenar.runtime import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.recording.guide import read_journal
from thenar.runtime.recording.session import Label, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.web.server import message
from thenar.studio.project import Project
from thenar.studio.studio import Station, Studio

from ..sets import grasp_set_of
from .sockets import PATIENCE_S, page, reply, until

Start = Callable[..., Studio]


def refusal(opened: Studio, **asked: object) -> str:
    """Return why a request is refused."""
    return str(reply(opened, asked)["why"])


def test_a_build_that_is_half_written_hides_nothing_else(
    studio: Start, two_builds: Path, hand: HandShape, tmp_path: Path
) -> None:
    folder = tmp_path / "recorded"
    shutil.copytree(two_builds, folder)
    Project(folder, hand).remember(build="more", wearer="A")
    (folder / "more" / "build.json").write_bytes((folder / "more" / "build.json").read_bytes()[:100])
    (folder / "half.grasps").write_bytes(b"half")
    with page(studio().server.url, "shell,set,recordings,wearing,work") as live:
        shown = dict[str, Any]()
        while not {"shell", "set", "recordings", "wearing"} <= {*shown} or "why" not in shown["work"]:
            told = json.loads(live.recv(timeout=PATIENCE_S))
            shown[told["topic"]] = told
    assert shown["shell"]["build"] == ""
    assert "build.json" in shown["wearing"]["why"]
    assert "build.json" in shown["work"]["why"]
    assert shown["set"]["name"] == "set.grasps"
    assert [said.partition(" is")[0] for said in shown["set"]["unused"]] == ["half.grasps"]


@pytest.fixture
def worn(two_builds: Path, people: GraspSet, hand: HandShape, tmp_path: Path) -> Path:
    """Return the folder of a project with two builds, which C wears, and C's trials."""
    folder = tmp_path / "recorded"
    shutil.copytree(two_builds, folder)
    Project(folder, hand).remember(build="more", wearer="C")
    people.rows(people.subjects == "C").save(folder / "C.grasps")
    return folder


def test_a_damaged_set_and_a_damaged_build_are_no_hindrance_to_a_wearer(studio: Start, worn: Path) -> None:
    (worn / "half.grasps").write_bytes(b"half")
    (worn / "few" / "build.json").write_bytes(b"{")
    with page(studio(None).server.url, "wearing,adapt") as live:
        shown = until(live, lambda told: bool(told["sets"]))
        assert shown["sets"] == ["C.grasps: 18 trials of 18 frames"]
        live.send(json.dumps({"do": "adapt"}))
        # The two may come in either order.
        told = [until(live, lambda told: told["topic"] == "adapt" or told.get("build") == "C") for _ in range(2)]
        assert {one["topic"]: one.get("folder") or one["base"] for one in told} == {"adapt": "C", "wearing": "more"}


def test_recordings_that_cannot_be_used_leave_a_wearer_recording_and_undo(studio: Start, worn: Path) -> None:
    mine = GraspSet.load(worn / "C.grasps")
    replace(mine, joints=mine.joints[:1], codes=mine.codes[:, :1]).save(worn / "C-2.grasps")
    (worn / "edits.jsonl").write_text("{}\n{}\n")
    opened = studio(None)
    with page(opened.server.url, "wearing") as live:
        shown = until(live, lambda told: bool(told["sets"]))
        assert (shown["why"], shown["base"], len(shown["sets"])) == ("", "more", 2)
        assert [note.partition(":")[0] for note in shown["notes"]] == [str(worn / "edits.jsonl")]
        (worn / "edits.jsonl").unlink()
        opened.changed()
        shown = until(live, lambda told: "adapt" in told)
    assert [note.partition(":")[0] for note in shown["notes"]] == ["C.grasps is left aside"]
    assert "/C.grasps" not in shown["adapt"]


def test_a_folder_that_is_gone_is_said_in_a_sentence(studio: Start, tmp_path: Path) -> None:
    opened = studio()
    shutil.rmtree(tmp_path / "recorded")
    why = refusal(opened, do="wearer", name="B")
    assert "No such file" in why
    assert "studio.json" in why
    assert "load the page again" in refusal(opened, do="use", id="0123456789ab")


def test_without_recordings_no_trial_is_edited(studio: Start, tmp_path: Path) -> None:
    """Also if a page sends the numbering of none. To have none yet is no failure."""
    opened = studio(None)
    with page(opened.server.url, "work") as live:
        told = until(live, lambda told: told["topic"] == "work" and (told["done"] == 1 or "why" in told))
    assert "why" not in told
    assert "not read yet" in refusal(opened, do="edit", name="cup")
    assert not (tmp_path / "recorded" / "edits.jsonl").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_is_read_only_is_said_in_a_sentence(studio: Start, tmp_path: Path) -> None:
    opened = studio()
    (tmp_path / "recorded").chmod(0o500)
    try:
        assert "Permission denied" in refusal(opened, do="wearer", name="B")
    finally:
        (tmp_path / "recorded").chmod(0o700)


def test_links_are_followed_and_names_that_are_no_text_left_out(
    people: GraspSet, hand: HandShape, tmp_path: Path
) -> None:
    folder, elsewhere = tmp_path / "mine", tmp_path / "disk"
    folder.mkdir()
    elsewhere.mkdir()
    people.save(elsewhere / "all.grasps")
    (folder / "linked.grasps").symlink_to(elsewhere / "all.grasps")
    (folder / "gone.grasps").symlink_to(elsewhere / "gone.grasps")
    (folder / 'naïve "set".grasps').symlink_to(elsewhere / "all.grasps")
    Path(os.fsdecode(bytes(folder) + b"/\xff.grasps")).write_bytes(b"")
    project = Project(folder, hand)
    assert [path.name for path in project.members("set").values()] == ["linked.grasps", 'naïve "set".grasps']
    assert len(project.recordings([folder / "linked.grasps"])[0]) == len(people)


@pytest.mark.parametrize("name", ["-o", "--help", ".hidden", "a/b"])
def test_a_name_that_a_command_or_a_folder_would_misread_is_refused(hand: HandShape, tmp_path: Path, name: str) -> None:
    with pytest.raises(SettingError, match="is not possible"):
        Project(tmp_path, hand).new_path(name)


def test_a_station_waits_for_no_device_and_a_recording_is_ended_by_nobody() -> None:
    told, slow, recorded = dict[str, object](), Event(), Event()

    def watch(_: Event) -> None:
        """Watch a device that is busy, and does not look whether it is to end."""
        slow.wait()

    def record(stop: Event) -> None:
        recorded.set()
        stop.wait()

    def publish(topic: str, content: object = None, **more: object) -> None:
        told[topic] = message(topic, content, **more)

    station = Station(publish)
    station.start("watching", watch)
    station.start("recording", record)
    assert station.doing == "recording"
    assert not recorded.is_set()
    slow.set()
    assert recorded.wait(PATIENCE_S)
    for other in ("watching", "calibrating", "live", "recording"):
        with pytest.raises(SettingError, match="in use: recording"):
            station.start(other, watch)
    station.close()
    assert station.doing == ""
    assert told["station"] == message("station", doing="", why="")


def test_a_run_is_ended_by_a_recording_alone_which_takes_its_keys() -> None:
    def work(stop: Event) -> None:
        stop.wait()

    station = Station(lambda *_, **__: None)
    station.start("live", work)
    for other in ("watching", "looking", "calibrating", "live"):
        with pytest.raises(SettingError, match="in use: live"):
            station.start(other, work)
    station.start("recording", work, ("accept",))
    station.press("accept")
    with pytest.raises(SettingError, match="no key 'quit' now"):
        station.press("quit")
    assert station.pressed() == ["accept"]
    station.close()


def test_a_bug_frees_the_glove_and_ends_no_studio(studio: Start, caplog: pytest.LogCaptureFixture) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError

    opened = studio()
    with page(opened.server.url, "station,work") as live:
        opened.station.start("watching", fail)
        assert until(live, lambda told: bool(told.get("why")))["why"] == "a bug in thenar: ZeroDivisionError"
        opened.queue("measure", fail)
        assert until(live, lambda told: told["topic"] == "work" and "why" in told)["why"].endswith("ZeroDivisionError")
        opened.changed()
        assert until(live, lambda told: told.get("done") == 1)["what"] == "reading"
    assert opened.station.doing == ""
    assert len(caplog.records) == 2


def test_a_recording_that_went_on_is_shown_as_it_is_now(
    studio: Start, two_builds: Path, people: GraspSet, tmp_path: Path
) -> None:
    folder = tmp_path / "recorded"
    shutil.copytree(two_builds, folder)
    opened, path = studio(None), folder / "rec.mcap"
    for trials in (1, 2):
        path.unlink(missing_ok=True)
        with Recorder(path, Session(thenar="1", switches=people.switch_names, sensors=())) as recorder:
            for time_us in range(0, trials * 1_000_000, 10_000):
                if time_us % 1_000_000 == 0:
                    recorder.label(Label(time_us, "begun", 1 + time_us // 1_000_000, "cup", "A", "cup"))
                recorder.frame(SwitchFrame(time_us, 1))
                if time_us % 1_000_000 == 990_000:
                    recorder.label(Label(time_us, "accepted", 1 + time_us // 1_000_000, "cup", "A", "cup"))
        ids = [one for kind in ("recording", "build") for one in opened.project.members(kind)][:2]
        with page(opened.server.url, "none") as live:
            live.send(json.dumps({"do": "replay", "ids": ids}))
            until(live, lambda told: told["topic"] == "replay")
        share, truth = 0.0, list[object]()
        while share < 1:
            with page(opened.server.url, "none") as live:
                live.send(json.dumps({"do": "overview", "ids": ids, "numbers": [0, 0]}))
                told = until(live, lambda told: told["topic"] == "overview")
                share, truth = told["share"], told["truth"]
        assert len(truth) == trials


TYPES = ("cup", "pen")
CLOSED = {"cup": {"s1": 1.0, "j1": 40.0}, "pen": {"s1": 0.0, "j1": 200.0}}


@pytest.fixture
def board() -> Iterator[tuple[LineServer, BoardSender]]:
    with LineServer() as line, BoardSender(line.send, ("s1",), ("j1",), 200) as board:
        yield line, board


def glove(line: LineServer) -> str:
    stream = f'port = "{line.port}"\nrate_hz = 200\nswitches = ["s1"]\njoints = {{ j1 = [0, 254] }}\n'
    return f'name = "bench"\n[[stream]]\n{stream}'


def lead(live: ClientConnection, board: BoardSender, done: int, *, adapts: bool) -> None:
    """Accept trials of a collection that begins, until so many are done."""
    told, step = until(live, lambda told: told["topic"] == "collecting" and told.get("adapts") == adapts), ""
    while told.get("done", 0) < done:
        before, step = step, str([told.get(name) for name in ("stage", "number", "done")])
        board.show(CLOSED.get(told.get("prompt", ""), {}))
        if step != before and "accept" in told.get("keys", {}):
            live.send(json.dumps({"do": "key", "name": "accept"}))
        told = until(live, lambda told: told["topic"] == "collecting")


def leave(live: ClientConnection) -> None:
    """Leave a collection, and wait until its set is written."""
    live.send(json.dumps({"do": "key", "name": "quit"}))
    until(live, lambda told: told["topic"] == "station" and not told["doing"])


@pytest.mark.slow
def test_what_was_begun_for_a_wearer_is_continued_on_the_page_record(
    studio: Start,
    board: tuple[LineServer, BoardSender],
    hand: HandShape,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Its set has the codes of the build, and adapts it; the command does not continue it for another build."""
    folder, labels = tmp_path / "recorded", np.arange(40) % 2
    folder.mkdir()
    coding = Joint("j1", "deg", 0, 0.0, 250, 500.0)
    codes = np.array([[20], [100]])[labels] + np.random.default_rng(2).integers(-9, 9, (40, 1))
    crowd = grasp_set_of(
        TYPES, labels, switches=labels[:, None] == 0, switch_names=("s1",), codes=codes, joints=(coding,)
    )
    compile_build(crowd, folder / "build", trainer="linear", folds=0, jobs=1, have=("s1", "j1"), sensors=2)
    compile_build(crowd, tmp_path / "other", trainer="linear", folds=0, jobs=1, have=("s1",), sensors=1)
    (folder / "glove.toml").write_text(glove(board[0]))
    Project(folder, hand).remember(build="build")
    opened = studio(None)
    with page(opened.server.url, "collecting,station,adapt,recordings") as live:
        live.send(json.dumps({"do": "wear"}))
        lead(live, board[1], 1, adapts=True)
        leave(live)
        assert len(read_journal(folder / "me.mcap").accepted) == 1
        assert GraspSet.load(folder / "me.grasps").joints == (coding,)
        command = ["record", "--glove", folder / "glove.toml", "--subject", "me", "-o", folder / "me.grasps"]
        assert run([*map(str, command), "--for", str(tmp_path / "other")]) == 2
        assert "begun with a different value of build" in " ".join(capsys.readouterr().err.split())
        (member,) = opened.project.members("recording")
        live.send(json.dumps({"do": "continue", "id": member}))
        lead(live, board[1], 4, adapts=True)
        leave(live)
        assert until(live, lambda told: told["topic"] == "adapt")["folder"] == "me"
    assert GraspSet.load(folder / "me.grasps").joints == (coding,)
    assert Build.load(folder / "me").manifest.adapted is not None


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_what_was_recorded_and_edited_outlives_the_studio(
    board: tuple[LineServer, BoardSender], hand: HandShape, tmp_path: Path, number: signal.Signals
) -> None:
    (tmp_path / "glove.toml").write_text(glove(board[0]))
    command = [sys.executable, "-m", "thenar.cli", "studio", str(tmp_path), "--web", "127.0.0.1:0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        url = process.stderr.readline().rpartition(" ")[2].strip()
        with page(url, "collecting,station") as live:
            live.send(json.dumps({"do": "record", "name": "A", "id": "own", "names": TYPES, "value": 2}))
            lead(live, board[1], 1, adapts=False)
            with page(url, "trials,edits") as strip:
                ((trial, grasp, _),) = until(strip, lambda told: bool(told.get("trials")))["trials"]
                other = next(name for name in TYPES if name != grasp)
                strip.send(json.dumps({"do": "relabel", "trial": trial, "name": other}))
                until(strip, lambda told: bool(told.get("made")))
            process.send_signal(number)
            assert process.wait(PATIENCE_S) == (0 if number == signal.SIGINT else -signal.SIGKILL)
    assert len(read_journal(tmp_path / "A.mcap").accepted) == 1
    recorded = tmp_path / "A.grasps"
    assert recorded.exists() == (number == signal.SIGINT)
    if number == signal.SIGKILL:
        import_recordings([tmp_path / "A.mcap"])[0].save(recorded)
    assert GraspSet.load(recorded).grasps.tolist() == [grasp]
    edited, _, unused = Project(tmp_path, hand).recordings()
    assert (edited.grasps.tolist(), unused) == ([other], [])
