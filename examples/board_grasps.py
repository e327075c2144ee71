"""Print the predictions and segments of a board in glove mode; names come from the build that it runs.

thenar firmware build/ --target avr2560 --mode glove --board board.toml -o firmware/ && make -C firmware/ flash
python board_grasps.py build/ /dev/ttyUSB0
"""

import sys

from thenar.drivers.scanner import Scanner
from thenar.runtime import Build

grasps = Build.load(sys.argv[1]).manifest.classes
with Scanner(sys.argv[2]) as board:
    shown, segment = None, ()
    while True:
        board.read(0.01)  # keys are not used here, but grasps arrive with their frames
        if board.grasp is not None and board.grasp != shown:
            shown = board.grasp
            name = "unknown" if shown.number is None else grasps[shown.number]
            doubt = " degraded" if shown.degraded else ""
            print(f"{shown.time_us} {name} ahead by {shown.margin} steps{doubt}", flush=True)
        if board.segment is not None and board.segment[1:] != segment:
            number, grasp, state = segment = board.segment[1:]
            print(f"segment {number}: {state} {'' if grasp is None else grasps[grasp]}", flush=True)
