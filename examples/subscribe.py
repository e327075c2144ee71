"""Subscribe to grasps. This side does not need thenar, and can be in any language.

thenar run build/ --glove glove.toml --sink unix:/tmp/grasps &
python subscribe.py /tmp/grasps
"""

import json
import socket
import sys

with socket.socket(socket.AF_UNIX) as server:
    server.connect(sys.argv[1])
    for line in server.makefile(encoding="utf-8"):
        message = json.loads(line)
        if message["kind"] == "grasp":
            print(message["number"], message["grasp"], f"{message['probability']:.0%}", message["health"], flush=True)
