"""The time until `thenar monitor` shows a moment of a long recording, compared with reading it from the start.

    python benchmarks/replaying.py [MINUTES]

The recording is synthetic: 500 frames of 30 switches, 500 recognitions and 100 records of 22 sensors a second.
"""

import sys
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.index import Index
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Session
from thenar.runtime.recording.writer import Recorder

SAMPLE_US, LEAD_US = 20_000, 1_500_000  # as the page has them
PLACES = 40


def write(path: Path, minutes: float) -> None:
    names = tuple(f"s{number}" for number in range(30)), tuple(f"j{number}" for number in range(22))
    session, types = Session(thenar="1", switches=names[0], sensors=names[1]), ("cup", "pen", "rod", "none")
    with Recorder(path, session, sync_s=1e9) as recorder:
        for number in range(round(30_000 * minutes)):
            now = 2000 * number
            arrived: list[SwitchFrame | GloveFrame] = [SwitchFrame(now, number // 400 % 1024)]
            if number % 5 == 0:
                arrived.append(GloveFrame(now, bytes(22)))
            name = types[number // 900 % 4]
            recorder.moment(arrived, LiveGrasp(now, now, number, name, name, 0.9, 3, "ok", 20, 30, 10))


def timed(work: object) -> float:
    began = perf_counter()
    for _ in work:  # type: ignore[attr-defined]
        pass
    return perf_counter() - began


def until(index: Index, unix_us: int) -> None:
    """Read as much as the page does to show a moment."""
    for at_us, _ in index.since(unix_us - LEAD_US):
        if at_us >= unix_us:
            return


def main() -> None:
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    with TemporaryDirectory() as folder:
        path = Path(folder) / "long.mcap"
        write(path, minutes)
        began = perf_counter()
        index = Index(path)
        scan = index.scan(SAMPLE_US)
        next(entry for _, entry in scan if isinstance(entry, LiveGrasp))
        first_s = perf_counter() - began
        scan_s = first_s + timed(scan)
        assert index.first_us is not None
        assert index.last_us is not None
        span, seeks = index.last_us - index.first_us, list[float]()
        for place in range(PLACES):
            began = perf_counter()
            until(index, index.first_us + span * (place * 17 % PLACES) // PLACES)
            seeks.append(perf_counter() - began)
        peak_mb = getrusage(RUSAGE_SELF).ru_maxrss / 1000
        whole_s = timed(Reader(path))
        print(f"{minutes:g} minutes, {path.stat().st_size / 1e6:.0f} MB; the Reader reads all of it in {whole_s:.1f} s")
        print(
            f"first moment after {1000 * first_s:.1f} ms; scanned after {scan_s:.1f} s, {scan_s / whole_s:.0%} of that"
        )
        print(f"any other moment after {1000 * median(seeks):.0f} ms, at most {1000 * max(seeks):.0f} ms")
        print(f"peak of memory {peak_mb:.0f} MB")


if __name__ == "__main__":
    main()
