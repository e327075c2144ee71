"""Collections and calibrations are led without the libraries of the compiler and of pages."""

import subprocess
import sys
from pathlib import Path

HEAVY = ("aiohttp", "jinja2", "joblib", "matplotlib", "scipy", "sklearn", "threadpoolctl")


def test_a_terminal_needs_no_library_of_the_workstation() -> None:
    modules = "thenar.studio.collecting, thenar.studio.calibrating, thenar.cli.collecting, thenar.cli.calibrate_command"
    program = f"import sys, {modules}\nprint([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_page_without_the_compiler_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "glove.toml").write_text('name = "bench"\n[[stream]]\nport = "/dev/none"\nswitches = ["a"]\n')
    words = ["record", "--glove", str(tmp_path / "glove.toml"), "--subject", "A", "--web", "127.0.0.1:0"]
    program = f"import sys\nsys.modules['sklearn'] = None\nfrom thenar.cli import run\nsys.exit(run({words}))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == 'thenar: sklearn is not installed: pip install "thenar[compiler]"\n'
