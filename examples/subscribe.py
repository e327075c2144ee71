"""Subscribe to grasps. Nothing of thenar is needed on this side, and any language will do.

thenar run build/ --glove glove.toml --sink unix:/tmp/grasps &
python subscribe.py /tmp/grasps
"""

import json
import socket
import sys

with socket.socket(socket.AF_UNIX) as server:
    server.connect(sys.argv[1])
    for line in server.makefile(encoding="utf-8"):
        told = json.loads(line)
        if told["kind"] == "grasp":
            print(told["number"], told["grasp"], f"{told['probability']:.0%}", told["health"], flush=True)
