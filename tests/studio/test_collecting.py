"""Collections and calibrations are led without the libraries of the compiler and of pages."""

import subprocess
import sys

HEAVY = ("aiohttp", "jinja2", "joblib", "matplotlib", "scipy", "sklearn", "threadpoolctl")


def test_a_terminal_needs_no_library_of_the_workstation() -> None:
    modules = "thenar.studio.collecting, thenar.studio.calibrating, thenar.cli.collecting, thenar.cli.calibrate_command"
    program = f"import sys, {modules}\nprint([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
