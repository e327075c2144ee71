"""`thenar run --web` and `thenar monitor` from the command line: what they say, what a page can do, how they end."""

import json
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic
from typing import Any
from urllib.request import urlopen

import pytest
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from .conftest import refusal, works

PATIENCE_S = 30


class Command:
    """A command that serves a page."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self.process, self.said = process, list[str]()
        self.url = self.until(r"thenar: the page is at (http://\S+)")

    def until(self, pattern: str) -> str:
        """Return what the first line on stderr says that matches."""
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.said.append(line)
            if found := re.search(pattern, line):
                return found[1] if found.groups() else found[0]
        raise AssertionError("".join(self.said))

    @contextmanager
    def page(self) -> Iterator[ClientConnection]:
        place = self.url.removeprefix("http://").partition("/")[0]
        how = {"origin": Origin(f"http://{place}"), "proxy": None, "compression": None}
        with connect(f"ws://{place}/live", **how) as live:  # type: ignore[arg-type]
            yield live

    def end(self) -> int:
        self.process.send_signal(signal.SIGINT)
        assert self.process.stderr is not None
        self.said += self.process.stderr
        return self.process.wait(PATIENCE_S)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Command]]:
    with ExitStack() as stack:

        def begin(*arguments: object) -> Command:
            command = [sys.executable, "-m", "thenar.cli", *map(str, arguments)]
            out = stack.enter_context((tmp_path / "stdout").open("wb"))
            process = subprocess.Popen(command, cwd=tmp_path, stdout=out, stderr=subprocess.PIPE, text=True)
            stack.enter_context(process)
            stack.callback(process.kill)
            return Command(process)

        yield begin


@pytest.fixture
def glove(tmp_path: Path) -> Path:
    """Return a harness whose board never comes: a run of it goes on all the same."""
    path = tmp_path / "glove.toml"
    names = [f"s{number}" for number in range(6)]
    path.write_text(f'name = "glove <b>"\n[[stream]]\nport = "{tmp_path}/none"\nswitches = {json.dumps(names)}\n')
    return path


def told(live: ClientConnection, topic: str, wanted: Callable[[Any], bool] = lambda _: True) -> Any:
    end = monotonic() + PATIENCE_S
    while monotonic() < end:
        message = json.loads(live.recv(timeout=PATIENCE_S))
        if message["topic"] == topic and wanted(message):
            return message
    raise AssertionError(f"no such message on {topic} came")


def ask(live: ClientConnection, **asked: object) -> None:
    live.send(json.dumps(asked))


def test_a_page_of_a_run_shows_it_and_takes_no_requests(
    start: Callable[..., Command], build_folder: Path, glove: Path, tmp_path: Path
) -> None:
    run, before = start("run", build_folder, "--glove", glove, "--web", "127.0.0.1:0"), set(tmp_path.rglob("*"))
    with run.page() as live:
        assert told(live, "shell")["project"] == "glove <b>"
        build = told(live, "build")
        assert (build["name"], build["grasps"]) == (build_folder.name, ["cup", "pen", "rod", "none"])
        assert build["hand"]["switches"]
        frame = told(live, "frame")
        assert (frame["grasp"], frame["probabilities"]) == ("unknown", None)
        assert told(live, "health")["devices"][0]["error"]
        assert told(live, "glove", lambda glove: "not connected" in glove["words"])["is"] == "bad"
        ask(live, do="record", name="one")
        assert told(live, "refused")["why"] == "this page takes no requests"
    assert run.end() == 0
    assert set(tmp_path.rglob("*")) == before


def test_the_token_is_said_once_and_asked_for(start: Callable[..., Command], build_folder: Path, glove: Path) -> None:
    run = start("run", build_folder, "--glove", glove, "--web", "127.0.0.1:0", "--web-token")
    token = run.url.partition("/?token=")[2]
    assert len(token) == 32
    with pytest.raises(Exception, match="403"), run.page():
        pass
    assert run.end() == 0
    assert "".join(run.said).count(token) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--web", "0.0.0.0:0"), "other machines can reach: add --web-token"),
        (
            ("--web", "nowhere"),
            "--web nowhere is not an address: write it as 127.0.0.1:8080, with a port from 0 to 65535",
        ),
        (("--web", ""), "is not an address"),
        (("--web", "no.such.host.invalid:80"), "there is no host no.such.host.invalid"),
        (("--web-token",), "--web-token has no effect without --web: leave it out"),
    ],
)
def test_what_cannot_be_is_one_sentence(build_folder: Path, glove: Path, options: tuple[str, ...], said: str) -> None:
    reason = refusal("run", build_folder, "--glove", glove, *options)
    assert said in reason
    assert reason.count("\n") == 1 or "nothing in" in reason


def test_a_port_that_is_taken_is_said_so(build_folder: Path, glove: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        place = f"127.0.0.1:{taken.getsockname()[1]}"
        assert f"--web {place} cannot be opened: Address already in use: another process serves" in refusal(
            "run", build_folder, "--glove", glove, "--web", place
        )


@pytest.fixture
def recording(build_folder: Path, glove: Path, tmp_path: Path) -> Path:
    path = tmp_path / "run.mcap"
    works("run", build_folder, "--glove", glove, "--frames", "20", "--record", path, "--sink", "jsonl:/dev/null")
    return path


def test_a_recording_is_shown_from_any_moment_of_it_to_each_page(
    start: Callable[..., Command], build_folder: Path, recording: Path
) -> None:
    monitor = start("monitor", recording, "--build", build_folder, "--web", "127.0.0.1:0")
    with monitor.page() as live, monitor.page() as other:
        assert told(live, "shell")["project"] == "run.mcap"
        about = told(live, "replay")
        assert (about["name"], about["builds"]) == ("run.mcap", [build_folder.name])
        assert about["hand"]["switches"]
        overview: dict[str, Any] = {"share": 0.0}
        while overview["share"] < 1:
            ask(live, do="overview", numbers=[0, 0])
            overview = told(live, "overview")
        assert (overview["truth"], overview["faults"]) == ([], [])
        assert overview["changes"][0][0][1] == "unknown"
        first, last = overview["first_us"], overview["last_us"]
        frames = list[dict[str, Any]]()
        for second in range(first // 10**6, last // 10**6 + 1):
            ask(live, do="moments", numbers=[second])
            # The first moment of a second may be the last one of the second before.
            frames += [frame for frame in told(live, "moments")["frames"] if frame not in frames]
        assert (frames[0]["number"], frames[-1]["number"], frames[-1]["change"][0]) == (0, 19, last)
        assert len(frames) <= 20
        # The other page has asked for nothing.
        assert [json.loads(other.recv(timeout=PATIENCE_S))["topic"] for _ in range(2)] == ["shell", "replay"]
        ask(other, do="moments", numbers=[first // 10**6])
        while (reply := json.loads(other.recv(timeout=PATIENCE_S)))["topic"] != "moments":
            assert reply["topic"] in ("shell", "replay")
        assert reply["frames"][0]["number"] == 0
        ask(live, do="moments", numbers=["x"])
        assert "for the moments of a recording, a page must send 1 of `numbers`" in told(live, "refused")["why"]
        ask(live, do="moments")
        assert told(live, "refused")["do"] == "moments"
        ask(live, do="delete")
        assert (
            "a page can ask for the overview or for moments of a recording, not 'delete'"
            in told(live, "refused")["why"]
        )
    assert monitor.end() == 0


def test_two_builds_stand_side_by_side_and_three_are_too_many(
    start: Callable[..., Command], build_folder: Path, recording: Path
) -> None:
    builds = ("--build", build_folder, "--build", build_folder)
    monitor = start("monitor", recording, *builds, "--web", "127.0.0.1:0")
    with monitor.page() as live:
        # Of the same name, they are told apart by their paths.
        assert told(live, "replay")["builds"] == [str(build_folder)] * 2
        ask(live, do="overview", numbers=[0, 0, 0])
        one, other = told(live, "overview")["changes"]
        assert one == other
    assert monitor.end() == 0
    assert "a page shows two builds at most: leave out a --build" in refusal("monitor", recording, *builds, *builds)


@pytest.fixture
def project(set_file: Path, tmp_path: Path) -> Path:
    """Return the folder of a project with a set."""
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "set.grasps").write_bytes(set_file.read_bytes())
    return folder


def test_the_studio_answers_until_a_signal_ends_it(start: Callable[..., Command], project: Path) -> None:
    studio = start("studio", project, "--jobs", "1", "--web", "127.0.0.1:0")
    with studio.page() as live:
        assert [sensor["kind"] for sensor in told(live, "set")["sensors"]] == 6 * ["switch"] + 2 * ["joint"]
        ask(live, do="choose", sensors=[0, 7])
        answer = told(live, "quick")
        assert (answer["sensors"], answer["of"]) == ([0, 7], "within subject")
        command = f"thenar compile {project}/set.grasps -o {project}/build --sensors 2 --have s0,j1"
        assert answer["commands"]["train"] == command
        ask(live, do="format", name="disk")
        assert "a page cannot 'format'" in told(live, "refused")["why"]
    assert studio.end() == 0


def test_a_signal_ends_the_studio_while_it_trains(start: Callable[..., Command], project: Path) -> None:
    studio = start("studio", project, "--jobs", "1", "--web", "127.0.0.1:0")
    with studio.page() as live:
        told(live, "set")
        ask(live, do="train", sensors=[0, 1, 7])
        while told(live, "work")["what"] != "train":
            pass
        assert studio.end() == 0
    assert not (project / "build").exists()


def test_what_is_no_recording_is_refused(build_folder: Path, recording: Path, tmp_path: Path) -> None:
    (tmp_path / "text.mcap").write_text("no")
    for name, said in (("none.mcap", "does not exist"), ("text.mcap", "does not begin like an MCAP file")):
        assert said in " ".join(refusal("monitor", tmp_path / name, "--build", build_folder).split())
    other = recording.read_bytes().replace(b"[[stream", b"[[strean")
    (tmp_path / "other.mcap").write_bytes(other)
    refusal("monitor", tmp_path / "other.mcap", "--build", build_folder)


@pytest.fixture
def wired(tmp_path: Path) -> Path:
    """Return a glove.toml in a folder for itself."""
    path = tmp_path / "project" / "glove.toml"
    path.parent.mkdir()
    path.write_text(f'name = "bench"\n[[stream]]\nport = "{tmp_path}/none"\nswitches = ["a", "b"]\n')
    return path


@pytest.mark.parametrize(
    ("words", "title", "wearer"),
    [
        (("record", "--subject", "Anna", "--glove"), "record", "Anna"),
        (("calibrate",), "glove", "me"),
    ],
)
def test_a_page_leads_what_the_terminal_leads(
    start: Callable[..., Command], wired: Path, words: tuple[str, ...], title: str, wearer: str
) -> None:
    command = start(*words, wired, "--web", "127.0.0.1:0")
    with urlopen(command.url, timeout=PATIENCE_S) as page:
        assert f"{title}.js" in page.read().decode()
    with command.page() as live:
        shell = told(live, "shell")
        assert (shell["project"], shell["wearer"]) == ("project", wearer)
        assert [name for _, name in shell["pages"]][:3] == ["Glove", "Record", "Choose"]
    assert command.end() == 0
    assert {path.name for path in wired.parent.iterdir()} <= {"glove.toml", "studio.json"}


def test_the_studio_of_a_folder_without_recordings_begins_with_the_glove(
    start: Callable[..., Command], wired: Path
) -> None:
    command = start("studio", wired.parent, "--web", "127.0.0.1:0")
    with urlopen(command.url, timeout=PATIENCE_S) as page:
        assert "glove.js" in page.read().decode()
    assert command.end() == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("record", "--subject", "A", "--web", "--repetitions", "3", "--glove"),
            "--repetitions has no effect with --web: choose it on the page: leave it out",
        ),
        (("record", "--subject", "A", "--glove"), "record on a page with --web"),
        (("record", "--subject", "A", "-o", "a.grasps", "--web-token", "--glove"), "--web-token has no effect"),
        (("calibrate", "--web", "-o", "a.toml"), "--output has no effect with --web"),
        (("calibrate",), "calibrate on a page with --web"),
    ],
)
def test_what_a_page_does_not_take_is_refused(wired: Path, words: tuple[str, ...], said: str) -> None:
    assert said in refusal(*words, wired)


def test_a_glove_of_another_name_has_no_page(glove: Path, tmp_path: Path) -> None:
    other = glove.rename(tmp_path / "mine.toml")
    assert "is the glove.toml of a project, not mine.toml: rename it" in refusal(
        "calibrate", other, "--web", "127.0.0.1:0"
    )
