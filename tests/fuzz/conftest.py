"""The mutators and the made-up frontier lie with the tests that use them, and are found as `run.py` finds them.

Before all else: a package that documentation is made with is called as a module here.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
