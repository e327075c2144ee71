"""`thenar service`: run a glove whenever the computer is on, by systemd."""

import shlex
import stat
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import click

from thenar.drivers.names import fault
from thenar.runtime.files import write_atomically

from .parameters import OutputFolder
from .printing import echo, warning

# Where each file of the folder `service` belongs.
_PLACES = {
    "thenar.conf": "etc/sysusers.d/thenar.conf",
    "thenar.rules": "etc/udev/rules.d/70-thenar.rules",
    "thenar.service": "etc/systemd/system/thenar.service",
}
_RELOAD = ("udevadm control --reload", "udevadm trigger", "systemctl daemon-reload")
_AFTER = {
    "install": ("systemd-sysusers", *_RELOAD, "systemctl enable thenar", "systemctl restart thenar"),
    "uninstall": _RELOAD,
}


@click.command("service", context_settings={"ignore_unknown_options": True})
@click.argument("action", metavar="install|uninstall|show", type=click.Choice(("install", "uninstall", "show")))
@click.argument("words", nargs=-1, type=click.UNPROCESSED, metavar="[BUILD OPTION...]")
@click.option("--root", type=OutputFolder(), default=Path("/"), help="Write below this folder, and start nothing.")
@click.option("--dry-run", is_flag=True, help="Only print the files and the commands.")
def command(action: str, words: tuple[str, ...], root: Path, dry_run: bool) -> None:
    """Install a service of systemd that runs `thenar run BUILD OPTION...` in this folder whenever the computer is on.

    Its user, thenar, is not root, and may read serial adapters, I2C and SPI by a rule of udev. It is started anew if it
    ends, or recognises no frame for 30 seconds. `show` prints what is installed, `uninstall` removes it.

    \b
    Example:
        thenar service install build/ --glove glove.toml --sink tcp:7777 --dry-run
        sudo /opt/thenar/bin/thenar service install build/ --glove glove.toml --sink mqtt:localhost/glove
        sudo /opt/thenar/bin/thenar service uninstall
    """
    if (action == "install") != bool(words):
        raise click.UsageError("name the build and options of thenar run after install, and nothing after the others")
    paths = {root / place: name for name, place in _PLACES.items()}
    texts = {path: path.read_text(encoding="utf-8") for path in paths if path.exists()}
    if words:
        texts = {path: _filled(name, words) for path, name in paths.items()}
    elif not texts:
        raise click.UsageError(f"no service of thenar is installed in {root}")
    shown = dry_run or action == "show"
    _run(["systemctl disable --now thenar"] * (action == "uninstall"), root, dry_run)
    try:
        for path, text in texts.items():
            if shown:
                echo(f"# {path}\n{text}")
            elif words:
                path.parent.mkdir(parents=True, exist_ok=True)
                write_atomically(path, text.encode())
            else:
                path.unlink()
    except PermissionError as reason:
        raise click.UsageError(f"{reason.filename}: {reason.strerror}: use sudo, or name a --root") from None
    _run(_AFTER.get(action, ()), root, dry_run)


def _filled(name: str, words: tuple[str, ...]) -> str:
    """Return the text of a file for a run with these words. Raises UsageError for words that run does not take."""
    from .run_command import command as run

    text = Path(__file__).with_name("service").joinpath(name).read_text(encoding="utf-8")
    if "@COMMAND@" not in text:
        return text
    asked = run.make_context("thenar run", [*words]).params
    if asked["glove"] is None:
        raise click.UsageError("a service runs on a glove: name its --glove")
    if reason := fault(str(Path.cwd()), 4095):
        raise click.UsageError(f"the path of this folder {reason}, so no service can name it: go to another")
    for path in (Path(sys.executable), asked["build"], asked["glove"]):
        parents = (*path.resolve().parents, *path.absolute().parents)  # a venv's Python is a link
        if closed := [above for above in parents if not above.stat().st_mode & stat.S_IXOTH]:
            warning(f"the user thenar cannot reach {path}: {closed[-1]} is closed to others; move it to /opt/thenar")
    line = " ".join(map(_quoted, (sys.executable, "-m", "thenar.cli", "run", *words)))
    return text.replace("@FOLDER@", str(Path.cwd()).replace("%", "%%")).replace("@COMMAND@", line)


def _quoted(word: str) -> str:
    """Return a word as a unit of systemd spells it, whose colon keeps "$"."""
    for letter, spelled in (("\\", "\\\\"), ('"', '\\"'), ("%", "%%"), ("\n", "\\n")):
        word = word.replace(letter, spelled)
    return f'"{word}"'


def _run(lines: Iterable[str], root: Path, dry_run: bool) -> None:
    """Run commands of the system, unless the files are another system's."""
    for line in lines if dry_run or root == Path("/") else ():
        echo(f"$ {line}")
        if not dry_run and subprocess.run(shlex.split(line), check=False).returncode:
            raise click.ClickException(f"{line} has failed: see above")
