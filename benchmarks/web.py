"""The cost of a page for the run that it shows, with no browser, one, ten, and ten with one that hangs.

    python benchmarks/web.py [--frames N] [--seconds S]

Each frame comes from memory, 400 per second, to a run without a page and to one with it, so that other load affects
both. Each case is a line: CPU of the run's thread per frame, and its increase over a run without a page (at most 20
us); wall time from a frame to its grasp; the load of the server's thread on a core; the frames per second that the
readers received. Readers are WebSockets in a separate process, on the same cores.

A second table is of the page in Chromium, if it is there, for a glove of 100 frames per second, and for a recording of
it that plays. It has the time from a frame until the page has drawn it (95 % within 60 ms), and updates per second. It
has the load of the page's process on a core (at most 15 %), messages and bytes per second, and the heap when it began
and at the end.
"""

import argparse
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import numpy as np
from liveplay import Memory, Played, board, glove, played, restless, with_glove
from rich.console import Console
from rich.table import Table

from thenar.runtime import Glove
from thenar.runtime.frames import now_us
from thenar.runtime.web.live import LivePage
from thenar.runtime.web.replay import Replay
from thenar.runtime.web.server import Server

if TYPE_CHECKING:
    from selenium.webdriver.remote.webdriver import WebDriver

MOST_US, HZ, WARM = 20, 400, 200
# Says when all are connected; at the end of its input, how many frames each reader got.
READERS = """
import asyncio, sys
from websockets.asyncio.client import connect
url, origin, readers, hanging = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
counts = [0] * readers
async def read(number, live):
    async for text in live:
        counts[number] += text.startswith('{"topic":"frame"')
async def main():
    how = dict(origin=origin, compression=None, proxy=None, ping_interval=None)
    live = [await connect(url, **how, max_queue=None if n < readers else 1) for n in range(readers + hanging)]
    tasks = [asyncio.create_task(read(number, each)) for number, each in enumerate(live[:readers])]
    print("connected", flush=True)
    line = await asyncio.get_running_loop().run_in_executor(None, sys.stdin.readline)
    print(*counts, flush=True)
    for each in live: each.transport.abort()
asyncio.run(main())
"""


@dataclass
class Case:
    """A run, and the costs of its frames."""

    what: str
    step: Callable[[], object]
    feed: Memory
    thread_us: list[float] = field(default_factory=list)
    wall_us: list[float] = field(default_factory=list)


def measured(cases: Sequence[Case], frames: list[tuple[int, bytes]]) -> None:
    """Send frames at their rate to every case, and record the costs."""
    due = time.perf_counter()
    for number, (closed, sensors) in enumerate(frames):
        due += 1 / HZ
        time.sleep(max(due - time.perf_counter(), 0))
        for case in cases if number % 2 else reversed(cases):
            case.feed.put(now_us(), closed, sensors)
            wall, own = time.perf_counter_ns(), time.thread_time_ns()
            case.step()
            case.thread_us.append((time.thread_time_ns() - own) / 1e3)
            case.wall_us.append((time.perf_counter_ns() - wall) / 1e3)


def run_of(
    scene: Played, what: str, stack: ExitStack, *, page: bool, record: Path | None = None
) -> tuple[Case, LivePage | None]:
    """Return a run with a sink, and its page."""
    harness, feed = with_glove(board(scene), glove(scene)), Memory(len(scene.kept))
    run = Glove(scene.build, harness, sinks=["jsonl:/dev/null?every"], status=True, feed=feed.take, record=record)
    if not page:
        stack.enter_context(run)
        return Case(what, lambda: next(run), feed), None
    server = stack.enter_context(Server("live", "127.0.0.1:0", token=None))
    shown = LivePage(server, run, scene.folder)
    stack.enter_context(run)
    return Case(what, lambda: shown.show(next(run)), feed), shown


@contextmanager
def readers(page: LivePage, number: int, hanging: int, found: list[str]) -> Iterator[None]:
    """Run `number` readers; `found` gets the frames per second of the slowest and the fastest of them."""
    place = urlsplit(page.server.url).netloc
    arguments = [f"ws://{place}/live", f"http://{place}", str(number), str(hanging)]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [sys.executable, "-c", READERS, *arguments], stdin=pipe, stdout=pipe, text=True, bufsize=1
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdout.readline()
        start = time.perf_counter()
        yield
        seconds = time.perf_counter() - start
        process.stdin.write("\n")
        counts = sorted(int(word) / seconds for word in process.stdout.readline().split())
        found.append(f"{counts[0]:.0f} to {counts[-1]:.0f}")


# Counts what the page is sent, and takes the time after it was drawn: in a task behind the page's own drawing.
WATCH = """
const Socket = WebSocket;
window.seen = { ages: [], messages: 0, bytes: 0 };
window.WebSocket = class extends Socket {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", ({ data }) => {
      seen.messages++;
      seen.bytes += data.length;
      if (!data.startsWith('{"topic":"frame"')) return;
      const [, us] = data.match(/"unix_us":([0-9]+)/), { port1, port2 } = new MessageChannel();
      port1.onmessage = () => seen.ages.push(performance.timeOrigin + performance.now() - us / 1000);
      requestAnimationFrame(() => port2.postMessage(0));
    });
  }
};
"""
PAGE_HZ = 100


def in_chromium(scene: Played, seconds: float, recording: Path) -> Iterator[tuple[str, ...]]:
    """Yield the lines of the page in Chromium: of runs, of which the first is recorded, and of that recording."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1400,1000"):
        options.add_argument(flag)
    frames = restless(len(scene.kept), round(PAGE_HZ * (seconds + 2)), seed=1)
    grasping = [frames[number // PAGE_HZ * PAGE_HZ] for number in range(len(frames))]
    for what, shown, record in (
        ("a hand that grasps", grasping, recording),
        ("all inputs by chance, in each frame", frames, None),
        ("a recording of the first, played", None, None),
    ):
        service = webdriver.ChromeService(executable_path=shutil.which("chromedriver"))
        driver = webdriver.Chrome(options=options, service=service)
        with ExitStack() as stack:
            stack.callback(driver.quit)
            driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": WATCH})
            if shown is None:
                driver.get(stack.enter_context(played_back(recording, scene.folder)).url)
                time.sleep(2)  # it is read
                driver.find_element("id", "play").click()
                pass_time = partial(time.sleep, seconds)
            else:
                case, page = run_of(scene, what, stack, page=True, record=record)
                assert page is not None
                driver.get(page.server.url)
                fed(case, shown[: 2 * PAGE_HZ])
                pass_time = partial(fed, case, shown[2 * PAGE_HZ :])
            # Drivers cannot be called while frames are fed by this thread: what is measured is measured at both ends.
            driver.execute_script("seen = { ages: [], messages: 0, bytes: 0 }")
            before, start = metrics_of(driver), time.perf_counter()
            pass_time()
            passed, after = time.perf_counter() - start, metrics_of(driver)
            seen = driver.execute_script("return seen")
            ages = np.percentile(seen["ages"] or [0], (50, 95))
            yield (
                what,
                f"{ages[0]:.0f} ms, {ages[1]:.0f} ms" if shown else "",
                f"{len(seen['ages']) / passed:.0f}" if shown else "",
                f"{(after['ProcessTime'] - before['ProcessTime']) / passed:.1%}",
                f"{seen['messages'] / passed:.0f}",
                f"{seen['bytes'] / passed / 1e3:.0f} kB",
                f"{before['JSHeapUsedSize'] / 1e6:.1f} to {after['JSHeapUsedSize'] / 1e6:.1f} MB",
            )


@contextmanager
def played_back(recording: Path, build: Path) -> Iterator[Server]:
    """Serve the page of a recording."""
    with (
        Replay(recording, [build]) as replay,
        Server("live", "127.0.0.1:0", token=None, on_message=replay.reply) as server,
    ):
        server.publish("replay", replay.about)
        yield server


def fed(case: Case, frames: Sequence[tuple[int, bytes]]) -> None:
    """Send frames at the rate of a usual glove."""
    due = time.perf_counter()
    for closed, sensors in frames:
        due += 1 / PAGE_HZ
        time.sleep(max(due - time.perf_counter(), 0))
        case.feed.put(now_us(), closed, sensors)
        case.step()


def metrics_of(driver: "WebDriver") -> dict[str, float]:
    """Return the measures of the page's process, by Chromium's names, after a collection of garbage."""
    driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
    driver.execute_cdp_cmd("Performance.enable", {})
    measures = driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return {measure["name"]: measure["value"] for measure in measures}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=4000, help="per case (default 4000)")
    parser.add_argument("--seconds", type=float, default=20.0, help="per case of the page in Chromium (default 20)")
    options = parser.parse_args()
    console = Console(width=180)
    busy = f"{os.getloadavg()[0]:.1f} processes were busy on {os.cpu_count()} cores when it began"
    console.print(f"{platform.machine()}, Python {platform.python_version()}; {busy}\n")
    table = Table(title=f"A frame of a run that shows itself (at most {MOST_US} µs more of the run's thread)")
    for name in ("", "run's thread: median, 99 %", "more", "frame to grasp: median, 99 %", "server", "frames/s shown"):
        table.add_column(name, justify="right" if table.columns else "left")
    with TemporaryDirectory() as name:
        scene = played("quick", Path(name))
        for what, number, hanging in (
            ("nobody looks", 0, 0),
            ("one browser", 1, 0),
            ("ten browsers", 10, 0),
            ("ten, and one that hangs", 10, 1),
        ):
            for case in compared(scene, what, number, hanging, options.frames) if options.frames else ():
                table.add_row(*case)
        console.print(table)
        if shutil.which("chromium") is not None:
            table = Table(title="The page in Chromium (95 % of frames within 60 ms, at most 15 % of a core)")
            titles = ("", "frame to page: median, 95 %", "updates/s", "renderer", "messages/s", "per second", "heap")
            for title in titles:
                table.add_column(title, justify="right" if table.columns else "left")
            for line in in_chromium(scene, options.seconds, Path(name) / "run.mcap"):
                table.add_row(*line)
            console.print(table)


def compared(scene: Played, what: str, number: int, hanging: int, frames: int) -> Iterator[tuple[str, ...]]:
    """Yield the line of a run without a page, and that of one with."""
    with ExitStack() as stack:
        plain, _ = run_of(scene, "  no page", stack, page=False)
        shown, page = run_of(scene, what, stack, page=True)
        assert page is not None
        found: list[str] = []
        clock = time.pthread_getcpuclockid(page.server.thread.ident or 0)
        with readers(page, number, hanging, found) if number else ExitStack():
            start, busy = time.perf_counter(), time.clock_gettime(clock)
            measured((plain, shown), restless(len(scene.kept), frames, seed=1))
            share = (time.clock_gettime(clock) - busy) / (time.perf_counter() - start)
        before = np.median(plain.thread_us[WARM:])
        for case in (plain, shown):
            own, wall = (np.percentile(each[WARM:], (50, 99)) for each in (case.thread_us, case.wall_us))
            yield (
                case.what,
                f"{own[0]:.0f} µs, {own[1]:.0f} µs",
                "" if case is plain else f"{own[0] - before:+.1f} µs",
                f"{wall[0]:.0f} µs, {wall[1]:.0f} µs",
                "" if case is plain else f"{share:.1%}",
                found[0] if found and case is shown else "",
            )


if __name__ == "__main__":
    main()
