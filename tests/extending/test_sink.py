import json
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any


def test_a_foreign_sink_is_in_the_help_and_gets_grasps(install: Callable[[str, str], Any], recorded: Path) -> None:
    package = install("sink.py", "thenar.sinks")
    help_text = " ".join(package.thenar("run", "--help").split())
    assert "udp:HOST:PORT, a datagram of JSON a grasp" in help_text
    grasps, build = recorded / "set.grasps", recorded / "build"
    assert "udp:HOST:PORT" in package.thenar("run", str(build), "--replay", str(grasps), "--sink", "udp", code=2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as reader:
        reader.bind(("127.0.0.1", 0))
        reader.settimeout(10.0)
        sink = f"udp:127.0.0.1:{reader.getsockname()[1]}"
        assert package.thenar("run", str(build), "--replay", str(grasps), "--sink", sink) == ""
        lines = [json.loads(reader.recv(65536)) for _ in range(60)]
    assert [line["number"] for line in lines] == list(range(60))
    assert {line["grasp"] for line in lines} == {"cup", "pen", "rod"}
    assert "no address" in package.thenar("run", str(build), "--replay", str(grasps), "--sink", "udp:here", code=2)
