"""The path of a live frame, from the bytes on the wire to a published grasp: its files, and the number of calls.

python benchmarks/liveway.py COUNTS ARGUMENT...   runs `thenar ARGUMENT...` and writes the calls it made to COUNTS
"""

import os
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path
from types import FrameType

import msgspec
from liveplay import Played, board, glove, performed, run_arguments, with_glove

from thenar.cli import run

# Runs of two lengths, whose difference is the path of a frame without start and end.
SHORT, LONG = 200, 1200
# The path of a frame is called at least once in this many grasps; functions called once a second are not.
_EVERY = 10
_OURS = f"{os.sep}thenar{os.sep}"
Calls = dict[str, int]


def way(scene: Played, folder: Path) -> tuple[list[str], float]:
    """Return the path of a row of a board and a CyberGlove, to JSON lines and a preshape: its files, and the calls of
    functions in them per grasp.
    """
    before, after = _calls(scene, folder, SHORT), _calls(scene, folder, LONG)
    found = {key: (count - before.get(key, 0)) / (LONG - SHORT) for key, count in after.items()}
    files = {key.partition("|")[0] for key, each in found.items() if each * _EVERY >= 1}
    return sorted(files), sum(found.values())


def _calls(scene: Played, folder: Path, frames: int) -> Calls:
    counts = folder / "calls"
    with performed(scene, with_glove(board(scene), glove(scene)), folder) as bench:
        options = ("--sink", "jsonl:/dev/null", "--frames", str(frames))
        arguments = run_arguments(scene.folder, bench.harness, folder, *options)
        subprocess.run([sys.executable, __file__, str(counts), *arguments], check=True, capture_output=True)
    return msgspec.json.decode(counts.read_bytes(), type=Calls)


def _profiled(path: Path, arguments: list[str]) -> None:
    """Run `thenar` and write how often each function of ours was called."""
    counts = Counter[str]()

    def hook(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and _OURS in code.co_filename:
            counts[f"{code.co_filename.rpartition(_OURS)[2]}|{code.co_qualname}"] += 1

    threading.setprofile(hook)
    sys.setprofile(hook)
    run(arguments)
    sys.setprofile(None)
    threading.setprofile(None)
    path.write_bytes(msgspec.json.encode(counts))


if __name__ == "__main__":
    _profiled(Path(sys.argv[1]), sys.argv[2:])
