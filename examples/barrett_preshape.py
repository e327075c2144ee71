"""Choose preshapes of a Barrett hand, and print each change: joint by joint, in rad.

thenar run build/ --glove glove.toml --sink "jsonl:-?every" | python barrett_preshape.py
"""

import sys

from msgspec import json

from thenar.runtime.preshape import PreshapeSelector, load_preshapes
from thenar.runtime.sinks import GraspLine, Line

selector = PreshapeSelector(load_preshapes("barrett_bh8"), min_probability=0.8, settle_ms=100)
shown = None
for line in sys.stdin.buffer:
    grasp = json.decode(line, type=Line)
    preshape = selector.update(grasp) if isinstance(grasp, GraspLine) else None
    if preshape is not None and preshape is not shown:
        joints = zip(preshape.joint_names, preshape.positions, strict=True)
        print(preshape.name, *(f"{name}={position:.3f}" for name, position in joints), flush=True)
        shown = preshape
