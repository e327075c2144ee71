"""`thenar service`: files below a folder, judged by systemd's own tools; and what a run tells systemd."""

import json
import os
import shlex
import socket
import subprocess
import sys
from configparser import ConfigParser
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from thenar.cli import notify, run
from thenar.runtime import Build

from ..conftest import tool
from ..sending import free_port

Captured = pytest.CaptureFixture[str]
UNIT = "etc/systemd/system/thenar.service"
FILES = {UNIT, "etc/udev/rules.d/70-thenar.rules", "etc/sysusers.d/thenar.conf"}


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "a b"
    (folder / "build").mkdir(parents=True)
    (folder / "glove.toml").touch()
    folder.chmod(0o700)
    monkeypatch.chdir(folder)
    return folder


def files(root: Path) -> set[str]:
    return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}


def service(root: Path, *words: str) -> int:
    return run(["service", *words, "--root", str(root)])


def verified(unit: Path) -> tuple[int, str]:
    command = [tool("systemd-analyze"), "verify", str(unit)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


INSTALL = ("install", "build", "--glove", "glove.toml")


def test_a_service_is_installed_shown_and_gone_again(tmp_path: Path, capsys: Captured) -> None:
    root = tmp_path / "root"
    assert service(root, *INSTALL, "--dry-run") == 0
    assert capsys.readouterr().out.splitlines()[-1] == "$ systemctl restart thenar"
    assert not files(root)
    assert service(root, *INSTALL) == 0
    assert files(root) == FILES
    said = capsys.readouterr().err
    assert "warning: the user thenar cannot reach build: /" in said
    assert "is closed to others; move it to /opt/thenar" in said
    assert service(root, "show") == 0
    shown = capsys.readouterr().out
    assert all(f"# {root / name}\n{(root / name).read_text()}" in shown for name in FILES)
    assert service(root, "uninstall", "--dry-run") == 0
    assert "$ systemctl disable --now thenar" in capsys.readouterr().out
    assert files(root) == FILES
    assert service(root, "uninstall") == 0
    assert not files(root)
    assert service(root, "show") == 2
    assert f"no service of thenar is installed in {root}" in capsys.readouterr().err


def test_it_runs_in_this_folder_without_root_and_is_watched(tmp_path: Path, place: Path) -> None:
    assert service(tmp_path, *INSTALL) == 0
    unit = ConfigParser(interpolation=None)
    unit.read(tmp_path / UNIT)
    found = unit["Service"]
    assert found["WorkingDirectory"] == str(place)
    assert (found["User"], found["Type"], found["Restart"]) == ("thenar", "notify", "always")
    assert int(found["WatchdogSec"]) > 2  # a run reports once a second
    assert shlex.split(found["ExecStart"])[1:] == ["-m", "thenar.cli", "run", *INSTALL[1:]]


def test_systemds_own_tools_find_no_fault(tmp_path: Path) -> None:
    assert service(tmp_path, *INSTALL, "--sink", 'jsonl:50 % of "$HOME"\n[Install]\\') == 0
    assert verified(tmp_path / UNIT) == (0, "")
    users = [tool("systemd-sysusers"), "--dry-run", str(tmp_path / "etc/sysusers.d/thenar.conf")]
    subprocess.run(users, capture_output=True, check=True)


def test_the_path_of_python_may_hold_what_systemd_expands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    python = tmp_path / "$HOME 50 % ä" / "python"
    python.parent.mkdir()
    python.symlink_to(sys.executable)
    monkeypatch.setattr(sys, "executable", str(python))
    assert service(tmp_path, *INSTALL) == 0
    assert verified(tmp_path / UNIT) == (0, "")


def test_a_python_that_is_linked_out_of_a_closed_folder_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    closed = tmp_path / "home"
    closed.mkdir(0o700)
    (closed / "python").touch()
    with TemporaryDirectory() as open_folder:
        Path(open_folder).chmod(0o755)
        python = Path(open_folder) / "python"
        python.symlink_to(closed / "python")
        monkeypatch.setattr(sys, "executable", str(python))
        assert service(tmp_path, *INSTALL) == 0
    assert f"warning: the user thenar cannot reach {python}: /" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("install",), "name the build and options of thenar run after install"),
        (("show", "build"), "name the build and options of thenar run after install"),
        (("install", "build", "--replay", "glove.toml"), "a service runs on a glove: name its --glove"),
        (("install", "other", "--glove", "glove.toml"), "'other' does not exist"),
        ((*INSTALL, "--lead", "high"), "'--lead': 'high' is not a valid float"),
    ],
)
def test_what_thenar_run_would_refuse_is_refused(
    tmp_path: Path, capsys: Captured, words: tuple[str, ...], said: str
) -> None:
    assert service(tmp_path / "root", *words) == 2
    assert said in capsys.readouterr().err
    assert not files(tmp_path / "root")


def test_a_state_reaches_an_abstract_socket_or_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notify(b"READY=1")
    monkeypatch.setenv("NOTIFY_SOCKET", f"@{tmp_path}")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(f"\0{tmp_path}")
        systemd.settimeout(10.0)
        notify(b"READY=1")
        assert systemd.recv(100) == b"READY=1"
    notify(b"WATCHDOG=1")


def test_a_live_run_reports_to_systemd_while_frames_come_and_no_longer(build_folder: Path, tmp_path: Path) -> None:
    port = free_port()
    manifest = Build.load(build_folder).manifest
    switches = [switch.name for switch in manifest.switches]
    joints = ", ".join(f"{joint.name} = [0, 255]" for joint in manifest.joints)
    harness, place = tmp_path / "glove.toml", str(tmp_path / "notify")
    stream = f'port = "udp://127.0.0.1:{port}"\nswitches = {json.dumps(switches)}\njoints = {{ {joints} }}\n'
    harness.write_text(f"[[stream]]\n{stream}")
    row = json.dumps(dict.fromkeys(switches, 0) | {joint.name: 100 for joint in manifest.joints}).encode()
    command = [sys.executable, "-m", "thenar.cli", "run", str(build_folder), "--glove", str(harness)]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(place)
        systemd.settimeout(30.0)
        environment = os.environ | {"NOTIFY_SOCKET": place}
        with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as process:
            try:
                assert systemd.recv(100) == b"READY=1"
                systemd.settimeout(1.5)
                with pytest.raises(TimeoutError):  # no glove yet
                    systemd.recv(100)
                systemd.settimeout(0.01)
                reports = list[bytes]()
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as glove:
                    for _ in range(3000):
                        glove.sendto(row, ("127.0.0.1", port))
                        with suppress(TimeoutError):
                            reports.append(systemd.recv(100))
                        if len(reports) == 2:
                            break
                assert reports == [b"WATCHDOG=1"] * 2
                systemd.settimeout(2.5)
                with suppress(TimeoutError):
                    systemd.recv(100)  # of what came last
                with pytest.raises(TimeoutError):
                    systemd.recv(100)
            finally:
                process.terminate()
            assert process.wait(20.0) == 0
