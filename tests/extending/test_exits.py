"""A package that calls sys.exit(0), on import or at work, is a fault that names it; no command ends in silence."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Install = Callable[..., Any]
SINK = """
import sys
from thenar.runtime.sinks import Sink, SinkKind

class Exits(Sink):
    def publish(self, grasp, preshape, angles):
        sys.exit(0)

MEMBER = SinkKind("exits", "PLACE", "ends the program", lambda where: Exits())
"""
METHOD = """
import sys
from thenar.compiler.placement.methods.base import Method, ranked

MEMBER = Method(name="exits", help="Ends the program", learn=ranked(lambda bits, labels: sys.exit(0)), sizes=(4, 16))
"""
GLOVE = """name = "maker"
[[stream]]
port = "tcp://127.0.0.1:1"
columns = ["s0", "s1", "s2"]
rate_hz = 100
switches = ["s0", "s1", "s2"]
"""


@pytest.fixture(scope="module")
def material(recorded: Path) -> Path:
    """The folder of recordings and a build, with a glove that nobody wears."""
    (recorded / "glove.toml").write_text(GLOVE)
    return recorded


@pytest.fixture
def plug_in(install: Install, tmp_path: Path) -> Callable[[str, str], Any]:
    """Install a module with this text, as a member of a group."""

    def installed(text: str, group: str) -> Any:
        (tmp_path / "exits.py").write_text(text)
        return install(tmp_path / "exits.py", group)

    return installed


@pytest.mark.parametrize(
    ("group", "command"),
    [
        ("thenar.methods", "place {}/set.grasps --keep 2"),
        ("thenar.trainers", "compile {}/set.grasps -o {}/new"),
        ("thenar.targets", "firmware {}/build --target host -o {}/firmware"),
        ("thenar.sinks", "run {}/build --replay {}/set.grasps --sink jsonl:{}/lines"),
        ("thenar.sources", "doctor {}/glove.toml"),
    ],
)
def test_on_import_it_ends_a_command_with_a_sentence(
    plug_in: Callable[[str, str], Any], material: Path, group: str, command: str
) -> None:
    there = plug_in("import sys\nsys.exit(0)\n", group)
    said = there.thenar(*command.replace("{}", str(material)).split(), code=2)
    assert "'member' (somebody_elses_exits:MEMBER) of another package cannot be loaded: SystemExit(0)" in said


def test_a_method_failing_at_work_ends_commands_with_a_sentence(
    plug_in: Callable[[str, str], Any], material: Path
) -> None:
    there = plug_in(METHOD, "thenar.methods")
    said = there.thenar("place", str(material / "set.grasps"), "--keep", "2", "--method", "exits", code=2)
    assert said.startswith("thenar: unexpected SystemExit in somebody_elses_exits: this is a bug; please report it")


def test_a_sink_that_does_so_is_left_out_of_a_replay(plug_in: Callable[[str, str], Any], material: Path) -> None:
    there, lines = plug_in(SINK, "thenar.sinks"), material / "replayed"
    command = ("run", str(material / "build"), "--replay", str(material / "set.grasps"))
    said = there.thenar(*command, "--sink", "exits:x", "--sink", f"jsonl:{lines}?every", code=1)
    assert "somebody_elses_exits.Exits: 0 frames sent, 60 lost: SystemExit: 0" in said
    assert [json.loads(line)["number"] for line in lines.read_text().splitlines()] == list(range(60))


def test_a_sink_that_does_so_stops_no_live_run(plug_in: Callable[[str, str], Any], material: Path) -> None:
    there, lines = plug_in(SINK, "thenar.sinks"), material / "live"
    command = ("run", str(material / "build"), "--glove", str(material / "glove.toml"), "--frames", "60", "--status")
    said = there.thenar(*command, "--sink", "exits:x", "--sink", f"jsonl:{lines}?every", code=1)
    assert "somebody_elses_exits.Exits: SystemExit: 0" in said
    assert "somebody_elses_exits.Exits: 0 frames sent, " in said
    assert sum(json.loads(line)["kind"] == "grasp" for line in lines.read_text().splitlines()) == 60
