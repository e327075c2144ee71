"""`thenar run --replay`: recorded frames, recognised again; and what is printed about sinks."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .printing import echo, err, say, warning

if TYPE_CHECKING:
    from thenar.runtime import Build
    from thenar.runtime.live.recogniser import Moment
    from thenar.runtime.policy import Policy
    from thenar.runtime.preshape import PreshapeSelector
    from thenar.runtime.published import LiveGrasp, Preshape
    from thenar.runtime.sinks import SinkReport


# From row to row of a set, which has no times of frames.
_PERIOD_US = 10_000


def selecting(build: "Build", preshape: str | None, *, segments: bool) -> "PreshapeSelector | None":
    """Return the selector of preshapes, if one was requested."""
    if preshape is None:
        return None
    from thenar.runtime.preshape import preshape_selector

    selector, lacking = preshape_selector(preshape, build, segments=segments)
    if lacking:
        err().print(f"thenar: {lacking}")
    return selector


def replay_recording(
    build: "Build",
    replay: Path,
    sinks: Sequence[str],
    selector: "PreshapeSelector | None",
    frames: int | None,
    policy: "Policy | None",
) -> None:
    """Recognise the frames of a live recording again, at their original times.

    Send them to the sinks as the live run did, or as JSON lines to stdout if there are none; on stderr, print how many
    match the recording.
    """
    from thenar.runtime.live.replay import replayed
    from thenar.runtime.sinks.jsonl import encode

    same = count = 0
    with _published(build, sinks, selector, lambda grasp, shape: encode(grasp, shape, None)) as publish:
        for then, now in islice(replayed(build, replay, policy, warning), frames):
            same += then == now.grasp
            count += 1
            publish(now.grasp, now)
    echo(f"{same} of {count} frames recognised as they were recorded", err=True)


def replay_set(
    build: "Build",
    replay: Path,
    sinks: Sequence[str],
    selector: "PreshapeSelector | None",
    frames: int | None,
) -> None:
    """Classify every row of a set of grasps alone and send it to each sink, or as a JSON line to stdout if there is
    none. `thenar verify` measures the accuracy.
    """
    import msgspec

    from thenar.compiler.artifact.verify import replayed
    from thenar.compiler.recordings.graspset import GraspSet

    grasp_set = GraspSet.load(replay)
    grasp_set = grasp_set.rows(range(len(grasp_set))[:frames])

    def line(grasp: "LiveGrasp", shape: "Preshape | None") -> bytes:
        shown = {
            "time_us": grasp.time_us,
            "grasp": grasp.grasp,
            "probability": round(grasp.probability, 6),
            "margin": grasp.margin,
            "degraded": grasp.health == "degraded",
            "recorded": str(grasp_set.grasps[grasp.number]),
        }
        return msgspec.json.encode(shown if selector is None else shown | {"preshape": shape}) + b"\n"

    with _published(build, sinks, selector, line) as publish:
        for grasp in replayed(build, grasp_set, _PERIOD_US):
            publish(grasp, None)


@contextmanager
def _published(
    build: "Build",
    sinks: Sequence[str],
    selector: "PreshapeSelector | None",
    line: "Callable[[LiveGrasp, Preshape | None], bytes]",
) -> "Iterator[Callable[[LiveGrasp, Moment | None], None]]":
    """Yield a function that publishes a replayed grasp with its preshape: to sinks, which wait for their readers, or
    without any as a `line` on stdout. At the end report losses, with exit code 1.
    """
    from thenar.runtime.sinks import Fanout, open_sink

    with ExitStack() as stack:
        opened = []
        for name in sinks:
            opened.append(open_sink(name, wait=True))
            stack.callback(opened[-1].close)
        fanout = Fanout(opened)
        fanout.begin(build)

        def publish(grasp: "LiveGrasp", moment: "Moment | None") -> None:
            shape = None if selector is None else selector.update(grasp)
            if opened:
                fanout.publish(grasp, shape, None, moment)
            else:
                sys.stdout.buffer.write(line(grasp, shape))

        yield publish
    sys.stdout.flush()
    say_what_was_lost(fanout.reports())
    if spoilt(fanout.reports()):
        click.get_current_context().exit(1)


def say_what_was_lost(reports: Sequence["SinkReport"]) -> None:
    """Print on stderr what was not sent."""
    for report in reports:
        if report.lost or report.error:
            why = f": {report.error}" if report.error else ""
            say(f"{report.where}: {report.sent} frames sent, {report.lost} lost{why}")


def spoilt(reports: Sequence["SinkReport"]) -> bool:
    """Return whether a sink failed, other than by a reader's leaving."""
    return any(report.error and not report.gone and report.readers is None for report in reports)
