"""The cost of a row of a sender, from its datagram to a published grasp."""

import socket
import time
from contextlib import closing
from pathlib import Path

import numpy as np
from liveplay import Played

from thenar.runtime import Glove
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.live.sources import FrameBuffer
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources.base import SOURCES, Source

COLUMNS, ROWS, _PORT = 30, 2000, 45_671


def row_us(scene: Played, folder: Path) -> tuple[float, float]:
    """Return microseconds of CPU a row of COLUMNS columns by UDP, medians: until its frames are there for the live
    loop, and from there to a published grasp, which goes to a file as JSON lines.

    Its columns are a clock, the build's joints and switches, and further switches. In every row half of the switches
    change, and all joints.
    """
    joints = [joint.name for joint in scene.build.manifest.joints]
    spare = COLUMNS - 1 - len(scene.kept) - len(joints)
    switches = [*scene.kept, *(f"spare_{number}" for number in range(spare))]
    ranges = ", ".join(f"{name} = [0, 1023]" for name in joints)
    harness = parse_harness(
        f'[[stream]]\nport = "udp://127.0.0.1:{_PORT}"\nrate_hz = 200\ntime = "ms"\n'
        f"columns = {['ms', *switches, *joints]!r}\nswitches = {switches!r}\njoints = {{ {ranges} }}\n",
        "rows",
    )
    scan = whole_scan(harness, scene.kept)
    (source,) = (source for kind in SOURCES.values() for source in kind.sources(harness, scene.kept, scan))
    buffer = FrameBuffer(len(scene.kept), [source.owned])
    draw = np.random.default_rng(1)
    rows = np.hstack([draw.integers(0, 2, (ROWS, len(switches))), draw.integers(0, 1024, (ROWS, len(joints)))])
    with (
        Glove(scene.build, harness, sinks=[f"jsonl:{folder}/rows.jsonl"], feed=buffer.take) as glove,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line,
        closing(source),
    ):
        source.open()
        found = []
        for number, row in enumerate(rows.tolist()):
            line.sendto(f"{5 * number},{','.join(map(str, row))}\n".encode(), ("127.0.0.1", _PORT))
            began_s = time.thread_time()
            _put(source, buffer)
            there_s = time.thread_time()
            next(glove)
            found.append((there_s - began_s, time.thread_time() - there_s))
    way, loop = 1e6 * np.median(found, axis=0)
    return float(way), float(loop)


def _put(source: Source, buffer: FrameBuffer) -> None:
    """Read a row: its switches and its joints."""
    for _ in range(2):
        frame = source.read(1.0)
        assert frame is not None
        if isinstance(frame, SwitchFrame):
            buffer.put_switches(0, frame, source.longest_us)
        else:
            buffer.put_glove(frame, source.longest_us)
