import fcntl
import os
import pty
import socket
import threading
import tty
from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import pytest

from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.serial_line import SerialLine

EVERY_BYTE = bytes(range(256))
SOON_S = 60.0


def read_exactly(line: SerialLine, size: int) -> bytes:
    data, end = b"", monotonic() + SOON_S
    while len(data) < size and monotonic() < end:
        data += line.read(end - monotonic())
    return data


class EchoLine(PtyLine):
    """A port that sends back what it is sent."""

    def __init__(self, link: Path) -> None:
        super().__init__(link, paced=False)
        self.receive = self.send


@pytest.fixture
def echo(tmp_path: Path) -> Iterator[EchoLine]:
    with EchoLine(tmp_path / "port") as line:
        yield line


def test_every_byte_passes_both_ways(echo: EchoLine) -> None:
    with SerialLine(str(echo.link), 115_200) as line:
        line.write(EVERY_BYTE)
        assert read_exactly(line, 256) == EVERY_BYTE


def test_reading_gives_up_at_its_timeout(echo: EchoLine) -> None:
    with SerialLine(str(echo.link), 115_200) as line:
        began = monotonic()
        assert line.read(0.05) == b""
        assert monotonic() - began >= 0.05
        assert line.read(0.0) == line.read(-1.0) == b""


def test_draining_takes_its_time_and_returns_what_came(echo: EchoLine) -> None:
    with SerialLine(str(echo.link), 115_200) as line:
        line.write(b"old")
        began = monotonic()
        assert line.drain(0.1) == b"old"
        assert monotonic() - began >= 0.1


def test_a_port_that_is_not_there_is_named_with_what_to_check(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"/none: there is no such port: .*plugged in") as raised:
        SerialLine(str(tmp_path / "none"), 115_200)
    assert isinstance(raised.value, OSError)


def test_folders_and_files_are_no_ports_and_stay(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(EVERY_BYTE)
    before = file.stat()
    with file.open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # opening it to try would find it in use
        for path in (file, tmp_path):
            with pytest.raises(DeviceError, match=rf"{path.name} is a (file|folder), not a device"):
                SerialLine(str(path), 115_200)
    assert file.read_bytes() == EVERY_BYTE
    assert (file.stat().st_mtime_ns, file.stat().st_ctime_ns) == (before.st_mtime_ns, before.st_ctime_ns)


@pytest.mark.parametrize("scheme", ["spy", "SPY", "alt", "loop", "hwgrep", "cp2110", "telnet", "file"])
def test_a_url_of_any_other_kind_is_refused_and_touches_no_file(tmp_path: Path, scheme: str) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"kept")
    for url in (f"{scheme}://{os.devnull}?file={victim}", f"{scheme}://{victim}", f"{scheme}://?file={victim}"):
        with pytest.raises(SettingError, match="is not a supported port: a port is a device such as"):
            SerialLine(url, 115_200)
    assert victim.read_bytes() == b"kept"


def test_a_baud_rate_of_nought_would_hang_up_and_is_refused(echo: EchoLine) -> None:
    with pytest.raises(SettingError, match="at least 1, not 0"):
        SerialLine(str(echo.link), 0)


def test_a_port_in_use_is_not_shared(echo: EchoLine) -> None:
    with SerialLine(str(echo.link), 115_200), pytest.raises(DeviceError, match="another program has it open"):
        SerialLine(str(echo.link), 115_200)
    SerialLine(str(echo.link), 115_200).close()


def test_a_pulled_plug_ends_a_reading(echo: EchoLine) -> None:
    with SerialLine(str(echo.link), 115_200) as line:
        pulling = threading.Timer(0.05, echo.unplug)
        pulling.start()
        with pytest.raises(DeviceError, match=r"port: the serial line is gone .*check cable"):
            line.read(SOON_S)
        pulling.join()
        with pytest.raises(DeviceError):
            line.write(b"x")


def test_a_closed_line_says_so_and_may_be_closed_again(echo: EchoLine) -> None:
    line = SerialLine(str(echo.link), 115_200)
    line.close()
    line.close()
    with pytest.raises(DeviceError):
        line.read(1.0)
    with pytest.raises(DeviceError):
        line.write(b"x")


def test_a_line_that_takes_nothing_does_not_hold_up_who_writes() -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    try:
        with SerialLine(os.ttyname(slave), 115_200) as line, pytest.raises(DeviceError, match="timeout"):
            line.write(bytes(1_000_000))
    finally:
        os.close(master)
        os.close(slave)


def test_a_tcp_socket_is_a_line_until_its_peer_goes() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(SOON_S)
        with SerialLine(f"socket://127.0.0.1:{server.getsockname()[1]}", 115_200) as line:
            peer, _ = server.accept()
            with peer:
                peer.settimeout(SOON_S)
                line.write(EVERY_BYTE)
                assert peer.recv(256) == EVERY_BYTE
                peer.sendall(EVERY_BYTE)
                assert read_exactly(line, 256) == EVERY_BYTE
            with pytest.raises(DeviceError, match="other end has hung up"):
                line.read(SOON_S)


def test_nobody_listening_is_told_as_such() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(DeviceError, match="refused"):
        SerialLine(f"socket://127.0.0.1:{port}", 115_200)


def test_a_redirected_port_name_is_an_error_a_missing_one_not(tmp_path: Path) -> None:
    """The port that is open may be there still: it is another device's."""
    with PtyLine(tmp_path / "first") as first, PtyLine(tmp_path / "second") as second:
        link = tmp_path / "port"
        link.symlink_to(first.link.readlink())
        with SerialLine(str(link), 115_200) as line:
            link.unlink()
            assert line.read(0.3) == line.read(0.0) == b""
            link.symlink_to(second.link.readlink())
            threading.Event().wait(0.2)
            with pytest.raises(DeviceError, match="another port than the one that was opened"):
                line.read(SOON_S)
