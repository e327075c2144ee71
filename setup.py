"""Stop where the packages are not linked: a checkout without symbolic links would install an empty thenar."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from setuptools import setup

if not Path("src/thenar/runtime/__init__.py").exists():
    sys.exit(
        "this checkout has no symbolic links, which src/thenar consists of: install a wheel (make dist, on Linux or "
        "macOS), or clone again with git clone -c core.symlinks=true"
    )
# Nothing is left in build/ of the checkout. The README's `thenar compile -o build/` would refuse that folder, and the
# next wheel would hold modules that were deleted meanwhile.
with TemporaryDirectory() as folder:
    setup(options={"build": {"build_base": folder}})
