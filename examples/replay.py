"""Recognise a recording once more, and say what comes out otherwise than it did then.

thenar run build/ --glove glove.toml --record run.mcap
python replay.py build/ run.mcap
"""

import sys
from pathlib import Path

from thenar.runtime import Build
from thenar.runtime.live.replay import replayed

frames = same = 0
for then, now in replayed(Build.load(sys.argv[1]), Path(sys.argv[2])):
    frames += 1
    same += now.grasp == then
    if now.grasp != then:
        print(f"frame {then.number}: {now.grasp.grasp}, then {then.grasp}")
print(f"{same} of {frames} frames recognised as they were recorded")
