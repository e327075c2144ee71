"""Run a build on a glove, and say what is recognised, and what a Barrett hand should do.

python run_build.py build/ glove.toml
"""

import contextlib
import sys

from thenar.runtime import Glove

with Glove(sys.argv[1], sys.argv[2], preshapes="barrett_bh8") as glove, contextlib.suppress(KeyboardInterrupt):
    for moment in glove:
        grasp, preshape = moment.grasp, moment.preshape
        print(grasp.grasp, f"{grasp.probability:.0%}", grasp.health, preshape and preshape.name, flush=True)
