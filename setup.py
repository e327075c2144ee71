"""Stop where the packages are not linked: a checkout without symbolic links would install an empty thenar."""

import sys
from pathlib import Path

from setuptools import setup

if not Path("src/thenar/runtime/__init__.py").exists():
    sys.exit(
        "this checkout has no symbolic links, which src/thenar consists of: install a wheel (make dist, on Linux or "
        "macOS), or clone again with git clone -c core.symlinks=true"
    )
setup()
