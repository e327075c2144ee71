"""Write a sink of one's own: this one says what a grasp had to do without. python own_sink.py build/ glove.toml"""

import sys
from threading import Event

from thenar.runtime import Build
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.live.loop import LiveLoop
from thenar.runtime.live.system import System
from thenar.runtime.sinks import Sink


class Doubts(Sink):
    """Says which switches and joints are missing."""

    def publish(self, grasp, preshape, angles):
        """Take one frame's result: never wait here, and never raise."""
        if grasp.lost:
            print(grasp.number, grasp.health, *grasp.lost, flush=True)


system, sink = System.of(Build.load(sys.argv[1]), load_harness(sys.argv[2])), Doubts()
with system.sources() as sources:
    loop = LiveLoop(sources, system.recognizer(), lambda moment: sink.publish(moment.grasp, None, None))
    loop.run(Event(), frames=500)
