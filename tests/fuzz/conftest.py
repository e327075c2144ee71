"""The mutators lie beside the tests that use them, and are found as `run.py` finds them."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
