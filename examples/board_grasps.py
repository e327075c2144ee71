"""Print what a board in glove mode recognises by itself, and its segments; names come from the build that it carries.

thenar firmware build/ --target avr2560 --mode glove --board board.toml -o firmware/ && make -C firmware/ flash
python board_grasps.py build/ /dev/ttyUSB0
"""

import sys

from thenar.drivers.scanner import Scanner
from thenar.runtime import Build

grasps = Build.load(sys.argv[1]).manifest.answers
with Scanner(sys.argv[2]) as board:
    told, segment = None, ()
    while True:
        board.read(0.01)  # keys are not asked for here, but their frames bring the grasps along
        if board.grasp is not None and board.grasp != told:
            told = board.grasp
            name = "unknown" if told.number is None else grasps[told.number]
            doubt = " degraded" if told.degraded else ""
            print(f"{told.time_us} {name} ahead by {told.margin} steps{doubt}", flush=True)
        if board.segment is not None and board.segment[1:] != segment:
            number, grasp, state = segment = board.segment[1:]
            print(f"segment {number}: {state} {'' if grasp is None else grasps[grasp]}", flush=True)
