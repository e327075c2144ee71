import os
import subprocess
import sys
from pathlib import Path

import pytest

# What LaTeX would be run by; what changes every picture; what never ends; what is no text.
SETTINGS = {
    "latex": b"text.usetex: True\ntext.latex.preamble: \\immediate\\write18{touch mark}\n",
    "style": b"lines.linewidth: 9\naxes.facecolor: red\nsvg.fonttype: none\n",
    "no text": b"\xff\xfe",
}
DRAW = """
import sys
from pathlib import Path
from thenar.compiler.pictures import painting, rendered
with painting(9):
    from matplotlib.figure import Figure
    figure = Figure(figsize=(2, 2))
    figure.subplots().plot([0, 1], [0, 1], label="line")
    figure.suptitle("a title")
    sys.stdout.buffer.write(rendered(figure, "svg"))
"""


def drawn_in(folder: Path, **environment: str) -> bytes:
    done = subprocess.run(
        [sys.executable, "-P", "-c", DRAW],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return drawn_in(tmp_path_factory.mktemp("plain"))


@pytest.mark.parametrize("name", SETTINGS)
def test_matplotlibs_settings_in_the_current_folder_change_no_picture(tmp_path: Path, plain: bytes, name: str) -> None:
    (tmp_path / "matplotlibrc").write_bytes(SETTINGS[name])
    assert drawn_in(tmp_path) == plain


def test_settings_that_never_end_are_not_read(tmp_path: Path, plain: bytes) -> None:
    (tmp_path / "matplotlibrc").symlink_to("/dev/zero")
    assert drawn_in(tmp_path) == plain


def test_the_users_own_settings_change_no_picture_either(tmp_path: Path, plain: bytes) -> None:
    (tmp_path / "mine").write_bytes(SETTINGS["style"])
    assert drawn_in(tmp_path, MATPLOTLIBRC=str(tmp_path / "mine")) == plain
