"""Where to listen: what is in the way stays unless it is dead, and no other machine is let in unless that is meant."""

import contextlib
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.published import LiveGrasp
from thenar.runtime.sinks import SinkError
from thenar.runtime.sinks.sockets import open_tcp, open_unix

SERVER = """\
import sys
from thenar.runtime.sinks.sockets import open_unix
sink = open_unix(sys.argv[1])
print("open", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "grasps"


def test_only_a_dead_processs_socket_is_replaced(path: Path) -> None:
    command = [sys.executable, "-c", SERVER, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
        assert server.stdout is not None
        assert server.stdout.readline() == b"open\n"
        with pytest.raises(SinkError, match="in use: another process serves it"):
            open_unix(str(path))
        server.send_signal(signal.SIGKILL)
    assert path.is_socket()
    open_unix(str(path)).close()
    assert not path.exists()


def test_a_file_folder_or_link_of_that_name_stays(path: Path) -> None:
    def refused() -> None:
        with pytest.raises(SinkError, match="another file has that name, and it is kept"):
            open_unix(str(path))

    path.write_text("precious")
    refused()
    assert path.read_text() == "precious"
    path.rename(path.with_suffix(".txt"))
    path.symlink_to(path.with_suffix(".txt"))
    refused()
    assert path.is_symlink()
    path.unlink()
    path.mkdir()
    refused()


def test_a_socket_of_another_kind_that_somebody_serves_stays(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other:
        other.bind(str(path))
        with pytest.raises(SinkError, match="in use"):
            open_unix(str(path))
    assert path.is_socket()


def test_closing_leaves_a_file_that_took_the_place(path: Path) -> None:
    sink = open_unix(str(path))
    path.unlink()
    path.write_text("precious")
    sink.close()
    assert path.read_text() == "precious"


def test_a_place_where_no_socket_can_be_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SinkError, match="No such file or directory"):
        open_unix(str(tmp_path / "nowhere" / "grasps"))
    with pytest.raises(SettingError, match="at most 107 bytes"):
        open_unix(str(tmp_path / ("long" * 50)))
    with pytest.raises(SettingError, match="no file can have that name"):
        open_unix("grasps\0")


def test_a_port_in_use_is_told_and_free_again_afterwards(make_grasp: Callable[..., LiveGrasp]) -> None:
    first = open_tcp("127.0.0.1:0")
    port = first.address[1]
    with pytest.raises(SinkError, match="another process serves that port"):
        open_tcp(f"127.0.0.1:{port}")
    with socket.create_connection(("127.0.0.1", int(port))) as reader:
        first.publish(make_grasp(), None, None)
        assert reader.recv(1 << 16)
        first.close()  # this side first: the system keeps the connection's end for a minute
    second = open_tcp(f"{port}")
    assert second.address == ("127.0.0.1", port)
    second.close()


@pytest.mark.parametrize("place", ["0.0.0.0:0", "[::]:0"])
def test_other_machines_are_let_in_only_where_that_is_said(place: str) -> None:
    with pytest.raises(SettingError, match=re.escape(f"write tcp:{place}?public")):
        open_tcp(place)
    open_tcp(place, public=True).close()


@pytest.mark.parametrize(
    "place", ["", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "::1:7777", "127.0.0.1:-1", "a b:1"]
)
def test_what_is_no_address_is_refused(place: str) -> None:
    with pytest.raises(SettingError, match="tcp:"):
        open_tcp(place)


def test_a_host_that_is_not_there_is_refused() -> None:
    with pytest.raises(SettingError, match="there is no host"):
        open_tcp(f"{'x' * 64}:7777")  # longer than any part of a host's name, so that no server is asked


def test_an_address_of_ipv6_stands_in_brackets() -> None:
    with contextlib.suppress(SinkError):  # a machine may be without IPv6
        sink = open_tcp("[::1]:0")
        assert sink.address[0] == "::1"
        sink.close()


@given(st.text(st.characters(exclude_characters="0123456789/"), max_size=8))
def test_no_text_raises_anything_but_our_own_errors(text: str) -> None:
    with pytest.raises(ThenarError):
        open_tcp(text)
