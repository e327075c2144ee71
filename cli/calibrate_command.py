"""`thenar calibrate`: calibrate a CyberGlove's sensors pose by pose, or taxels from rest and presses."""

import os
import select
import sys
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import click

from thenar.drivers.names import shortened
from thenar.drivers.ports import port_fault

from .consoles import Live, Table
from .parameters import Number, OutputFile, existing_file, keep_apart, overwrite_flag
from .printing import echo, err, table

if TYPE_CHECKING:
    from thenar.drivers.calibration import GloveCalibration
    from thenar.runtime.harness.wiring import Harness
    from thenar.runtime.live.sources import Sources
    from thenar.runtime.posing import PoseGuide, PoseKey
    from thenar.runtime.taxels import TaxelCalibration

Codes = tuple[int | None, ...]

_WAIT_S, _WAIT_US = 0.05, 50_000
_REFRESH_S = 0.1
_PATIENCE_S = 5.0
# Nobody presses for an hour during a calibration.
_MOST_FRAMES = 1_000_000


def _device(context: click.Context, argument: click.Parameter, text: str) -> str:
    """Return the port, or the path of a glove.toml, which --taxels always expects."""
    if context.params.get("taxels") or text.endswith(".toml"):
        return str(existing_file.convert(text, argument, context))
    if fault := port_fault(text):
        raise click.BadParameter(f"{shortened(repr(text))} {fault}")
    return text


@click.command("calibrate")
@click.argument("port", metavar="PORT|glove.toml", callback=_device)
@click.option("-o", "--output", type=OutputFile(".toml"), required=True, help="The .toml file to write.")
@overwrite_flag
@click.option("--subject", help="Name of the subject.  [default: the file's name]")
@click.option("--baud", type=click.IntRange(1, 12_000_000), default=115_200, show_default=True, help="Baud rate.")
@click.option("--taxels", is_flag=True, is_eager=True, help="Calibrate the taxels of a glove.toml, not a CyberGlove.")
@click.option("--newtons", type=Number(0.001, 1000), help="Force of the presses, if known; with --taxels.")
@click.option("--hold", type=Number(0.05, 60), default=1.0, show_default=True, help="Time to hold each pose, seconds.")
def command(
    port: str,
    output: Path,
    subject: str | None,
    baud: int,
    taxels: bool,
    newtons: float | None,
    hold: float,
) -> None:
    """Calibrate the CyberGlove at PORT (/dev/ttyUSB0, socket://HOST:PORT, ...) for its wearer. Given a glove.toml,
    calibrate the joints of its [[stream]], or its taxels with --taxels.

    The command asks for a flat hand, a fist and five more poses, shows the sensor values, and takes each pose when you
    press Enter. For taxels, leave all untouched first, then press each one once. The file is written at the end; until
    then, Ctrl-C keeps the old one.

    \b
    Example:
        thenar calibrate /dev/ttyUSB0 -o anna.toml
        thenar calibrate glove.toml --taxels -o pads.toml
        thenar calibrate glove.toml -o anna.toml
    """
    from thenar.runtime.names import fault

    wearer = subject or output.stem
    if reason := fault(wearer):
        raise click.UsageError(f"subject {shortened(repr(wearer))} {reason}: give another with --subject")
    if newtons is not None and not taxels:
        raise click.UsageError("--newtons is the force of presses on taxels: add --taxels")
    if port.endswith(".toml"):
        keep_apart(Path(port), output)
    if taxels:
        with _sources(Path(port), taxels=True) as (harness, sources):
            pads = _pressed(harness.taxel_names, sources, hold, wearer, newtons)
        said = _written(output, "taxel", [line.name for line in pads.taxels], harness.taxel_names, pads)
        echo(f"{said}; name it under [taxels] of {Path(port).name}")
        return
    with _posing(port, baud, hold) as (guide, take):
        _lead(guide, take)
    lines = guide.calibration(wearer)
    echo(_written(output, "sensor", [line.name for line in lines.sensors], guide.names, lines))


def _written(
    output: Path,
    kind: str,
    found: Sequence[str],
    names: Sequence[str],
    lines: "GloveCalibration | TaxelCalibration",
) -> str:
    """Write the calibration, say which of `names` it lacks, and return the line to print."""
    from thenar.runtime.files import write_atomically

    if not found:
        raise click.ClickException(f"no {kind} moved, so nothing can be calibrated: {output} is not written")
    if left_out := [name for name in names if name not in found]:
        echo(f"Not calibrated, because they did not move: {', '.join(left_out)}", err=True)
    write_atomically(output, lines.to_toml().encode("utf-8"))
    return f"{output}: {len(found)} {kind}s of {lines.subject}"


@contextmanager
def _sources(glove: Path, *, taxels: bool) -> "Iterator[tuple[Harness, Sources]]":
    """Yield the harness that is calibrated, and its open devices: those with taxels, or the stream with joints.

    Raises UsageError if there are none, or if they use stdin, where the user types.
    """
    from msgspec.structs import replace

    from thenar.runtime.harness.loading import load_harness
    from thenar.runtime.harness.wiring import StreamWiring
    from thenar.runtime.live.sources import Sources
    from thenar.runtime.scanning.ports import whole_scan
    from thenar.runtime.taxels import TaxelSettings

    harness = replace(load_harness(glove), taxel_settings=TaxelSettings())  # it may name the file to be written
    if taxels and not harness.taxel_names:
        raise click.UsageError(f"{glove.name} names no taxels: add `taxels` to a [[stream]], or add a converter")
    if not taxels:
        device = harness.joint_device
        if not isinstance(device, StreamWiring):
            raise click.UsageError(f"{glove.name} has no [[stream]] with joints: name the port of the CyberGlove")
        harness = replace(harness, buses=(), spi=(), streams=(device,))
    if "-" in [stream.port for stream in harness.streams]:
        raise click.UsageError("the keys that lead a calibration come from stdin: send rows by udp: instead")
    with Sources(harness, (), whole_scan(harness, (), every_taxel=taxels)) as sources:
        yield harness, sources


def _await(sources: "Sources", read: Callable[[], Any], what: str) -> None:
    """Wait until something is read. Raises DeviceError if no data comes, SettingError for a device that cannot work."""
    from thenar.drivers.errors import DeviceError

    end = monotonic() + _PATIENCE_S
    while not read():
        sources.raise_settings()
        if monotonic() > end:
            wrong = [f"{device.name}: {device.error}" for device in sources.devices() if device.error]
            raise DeviceError(f"{wrong[0] if wrong else f'no device sends {what}'}; nothing is calibrated")


@contextmanager
def _posing(port: str, baud: int, hold_s: float) -> "Iterator[tuple[PoseGuide, Callable[[], None]]]":
    """Yield a guide through the poses of a CyberGlove, or of the stream of a glove.toml, and a function that waits for
    the next bytes and passes them to it.
    """
    from thenar.drivers.cyberglove import CyberGlove
    from thenar.drivers.errors import DeviceError
    from thenar.runtime.frames import GloveFrame, now_us, old_after_us
    from thenar.runtime.posing import PoseGuide

    def take(read: Callable[[], bytes | None], guide: PoseGuide) -> None:
        raw = read()
        if raw is not None:
            guide.take(now_us(), raw)

    def row() -> bytes | None:
        """Return the newest row that measures every joint."""
        arrived = sources.take(_WAIT_US).arrived
        whole = [frame.sensors for frame in arrived if isinstance(frame, GloveFrame) and 0 not in frame.sensors]
        return whole[-1] if whole else None

    def record() -> bytes | None:
        timed = glove.read(_WAIT_S)
        if timed is not None and timed[1].fault == "unplugged":
            raise DeviceError(f"{port}: the glove is not plugged into its box")
        return None if timed is None else timed[1].sensors

    hold_us = round(hold_s * 1e6)
    if port.endswith(".toml"):
        with _sources(Path(port), taxels=False) as (harness, sources):
            _await(sources, row, "joints")
            guide = PoseGuide(harness.sensor_names, hold_us, old_after_us(sources.glove_period_us))
            yield guide, partial(take, row, guide)
        return
    glove = CyberGlove(port, baud=baud)
    try:
        info = glove.open()
        for note in info.notes:
            echo(note, err=True)
        guide = PoseGuide(info.names, hold_us, old_after_us(None))
        yield guide, partial(take, record, guide)
    finally:
        glove.close()


def _lead(guide: "PoseGuide", take: Callable[[], None]) -> None:
    """Lead through the poses on stderr, each asked for until it succeeds, showing the bytes live on a terminal.

    Raises click.Abort if the user quits, DeviceError if the glove is disconnected or unplugged.
    """
    from thenar.runtime.frames import now_us

    typed = TypedLines(sys.stdin.fileno())

    def drawn() -> Table:
        shown = table(("sensor", "byte", "this pose's", ""))
        for name, byte, state in zip(guide.names, guide.raw or b"", guide.states(), strict=False):
            shown.add_row(name, str(byte), "yes" if name in guide.pose.degrees else "", state)
        return shown

    while guide.stage != "done":
        if guide.stage == "held":
            take()
            continue
        keys: dict[str, PoseKey]
        if guide.stage == "doubted":
            for problem in guide.problems:
                echo(f"  {problem}", err=True)
            question, keys = "Enter to hold it again (k: keep it anyway, q: quit)", {"k": "keep"}
        else:
            number = f"{len(guide.taken) + 1} of {len(guide.poses)}"
            echo(f"\nPose {number}, {guide.pose.name}: {guide.pose.instruction}", err=True)
            question = "Enter when you hold it (b: back to the previous pose, q: quit)"
            keys = {"b": "back"}
        reply = typed.ask(question, keys, take, drawn)
        if guide.silent(now_us()):
            echo("The glove is silent: waiting until it sends.", err=True)
            while guide.silent(now_us()):
                take()
        guide.press(now_us(), keys.get(reply, "accept"))


def _pressed(
    names: Sequence[str], sources: "Sources", hold_s: float, subject: str, newtons: float | None
) -> "TaxelCalibration":
    """Ask on stderr for a glove at rest, then for a press of every taxel, and show the counts live on a terminal.

    Raises DeviceError if no device sends taxels, click.Abort if the user quits.
    """
    from thenar.runtime.frames import SwitchFrame
    from thenar.runtime.taxels import TaxelCalibration, learnt_lines

    typed = TypedLines(sys.stdin.fileno())
    rested, codes = list[Codes](), list[Codes]()

    def take() -> list[Codes]:
        arrived = sources.take(_WAIT_US).arrived
        codes.extend(frame.taxels for frame in arrived if isinstance(frame, SwitchFrame) and frame.taxels is not None)
        del codes[:-_MOST_FRAMES]
        return codes

    def drawn() -> Table:
        shown = table(("taxel", "counts", "at rest"))
        columns = (frames[-1] if frames else (None,) * len(names) for frames in (codes, rested))
        for name, *counts in zip(names, *columns, strict=True):
            shown.add_row(name, *("" if count is None else str(count) for count in counts))
        return shown

    _await(sources, take, "taxels")
    echo("Leave every taxel alone, the hand open: press nothing.", err=True)
    typed.ask("Enter when nothing is pressed (q: quit)", (), take, drawn)
    codes.clear()
    end = monotonic() + hold_s
    while monotonic() < end or not codes:
        take()
    rested.extend(codes)
    codes.clear()
    echo("Press every taxel once, firmly, for half a second each, in any order.", err=True)
    typed.ask("Enter when all were pressed (q: quit)", (), take, drawn)
    lines = learnt_lines(names, rested, codes, 1.0 if newtons is None else newtons)
    return TaxelCalibration(subject=subject, unit="press" if newtons is None else "N", taxels=lines)


class TypedLines:
    """Whole lines from a file descriptor, read without blocking."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._rest = b""

    def ask(
        self, question: str, replies: Container[str], take: Callable[[], object], drawn: Callable[[], Table]
    ) -> str:
        """Return "" or one of the `replies`, asking on stderr until one is typed. Meanwhile `take` readings, and on a
        terminal show them as `drawn`. Raises click.Abort for a q.
        """
        console = err()
        while True:
            echo(question, err=True)
            shown_s = 0.0
            with Live(console) as live:
                while (reply := self.take()) is None:
                    take()
                    if console.is_terminal and monotonic() - shown_s > _REFRESH_S:
                        live.update(drawn())
                        shown_s = monotonic()
            if reply == "q":
                raise click.Abort
            if not reply or reply in replies:
                return reply
            echo(f"'{reply}' is not one of the keys: type one that the question names", err=True)

    def take(self) -> str | None:
        """Return the next line, stripped, or None if none is complete. Raises click.ClickException at the end."""
        if b"\n" not in self._rest and select.select([self._descriptor], [], [], 0.0)[0]:
            typed = os.read(self._descriptor, 4096)
            if not typed:
                raise click.ClickException("the input ended before the last question: nothing is written")
            self._rest += typed
        line, end, rest = self._rest.partition(b"\n")
        if not end:
            return None
        self._rest = rest
        return line.decode("utf-8", "replace").strip()
