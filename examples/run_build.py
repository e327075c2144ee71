"""Run a build on a glove, and say what is recognised.

python run_build.py build/ glove.toml
"""

import contextlib
import sys
import time

from thenar.runtime import Build
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.live.frames import now_us
from thenar.runtime.live.system import System

system = System.of(Build.load(sys.argv[1]), load_harness(sys.argv[2]))
recognizer = system.recognizer()
with system.sources() as sources, contextlib.suppress(KeyboardInterrupt):
    while True:
        sources.wait(sources.patience_s)  # for something new, but no longer than it takes to grow old
        newest = sources.take()
        grasp = recognizer.step(now_us(), time.time_ns() // 1000, newest.switches, newest.glove)
        print(grasp.grasp, f"{grasp.probability:.0%}", grasp.health, flush=True)
