"""Subscribe to grasps. This side does not need thenar, and can be in any language.

thenar run build/ --glove glove.toml --sink tcp:7777 &
python subscribe.py 7777
"""

import json
import socket
import sys

with socket.create_connection(("127.0.0.1", int(sys.argv[1]))) as server:
    for line in server.makefile(encoding="utf-8"):
        message = json.loads(line)
        if message["kind"] == "grasp":
            print(message["number"], message["grasp"], f"{message['probability']:.0%}", message["health"], flush=True)
