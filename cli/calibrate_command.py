"""`thenar calibrate`: calibrate a CyberGlove's sensors pose by pose, or taxels from rest and presses."""

import os
import select
import sys
from functools import partial
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import click
from rich.live import Live
from rich.table import Table

from .common import Number, OutputFile, err, existing_file, keep_apart, overwrite_flag, serial_port
from .lines import echo
from .web_options import token_for, web_options

if TYPE_CHECKING:
    from thenar.drivers.cyberglove import CyberGlove, GloveInfo
    from thenar.runtime.harness.wiring import Harness
    from thenar.runtime.live.sources import Sources
    from thenar.runtime.posing import PoseGuide
    from thenar.runtime.taxels import TaxelCalibration

_WAIT_S = 0.05
_REFRESH_S = 0.1

_WAIT_US = 50_000
_PATIENCE_S = 5.0
# Nobody presses for an hour during a calibration.
_MOST_FRAMES = 1_000_000

Codes = tuple[int | None, ...]


def _rate(_context: click.Context, _option: click.Parameter, text: str) -> int | None:
    """Return the baud rate, or None for auto."""
    if text == "auto":
        return None
    if not text.isdecimal() or not 0 < int(text) < 10**8:
        raise click.BadParameter(f"'{text}' is neither a baud rate nor auto")
    return int(text)


def _device(context: click.Context, argument: click.Parameter, text: str) -> str:
    """Return the port, or the path of a glove.toml, which --taxels always expects."""
    if context.params.get("taxels") or text.endswith(".toml"):
        return str(existing_file.convert(text, argument, context))
    return serial_port(context, argument, text)


@click.command("calibrate")
@click.argument("port", metavar="PORT|glove.toml", callback=_device)
@click.option("-o", "--output", type=OutputFile(".toml"), required=True, help="The .toml file to write.")
@overwrite_flag
@click.option("--subject", help="Name of the subject.  [default: the file's name]")
@click.option("--baud", callback=_rate, default="115200", show_default=True, help="Baud rate, or auto to detect it.")
@click.option("--sensors", type=click.Choice(["18", "22"]), help="Expected sensor count.  [default: as reported]")
@click.option("--taxels", is_flag=True, is_eager=True, help="Calibrate the taxels of a glove.toml, not a CyberGlove.")
@click.option("--newtons", type=Number(0.001, 1000), help="Force of the presses, if known; with --taxels.")
@click.option("--hold", type=Number(0.05, 60), default=1.0, show_default=True, help="Time to hold each pose, seconds.")
@web_options
def command(
    port: str,
    output: Path,
    subject: str | None,
    baud: int | None,
    sensors: str | None,
    taxels: bool,
    newtons: float | None,
    hold: float,
    web: str | None,
    web_token: bool,
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
        thenar calibrate /dev/ttyUSB0 -o anna.toml --web
    """
    from thenar.drivers.cyberglove import CyberGlove
    from thenar.runtime.frames import old_after_us
    from thenar.runtime.names import fault, shortened

    wearer = subject or output.stem
    if reason := fault(wearer):
        raise click.UsageError(f"subject {shortened(repr(wearer))} {reason}: give another with --subject")
    if taxels and web is not None:
        raise click.UsageError("--web shows poses of joints, not taxels: leave out --web or --taxels")
    if taxels:
        _calibrate_taxels(Path(port), output, wearer, newtons, hold)
        return
    if newtons is not None:
        raise click.UsageError("--newtons is the force of presses on taxels: add --taxels")
    glove: CyberGlove | StreamedJoints
    if port.endswith(".toml"):
        glove = StreamedJoints(Path(port), output)
        if web is None:
            _keep_stdin([glove.url])
    else:
        glove = CyberGlove(port, baud=baud, sensors=int(sensors) if sensors else None)

    written = partial(_written, output, wearer)
    try:
        info = glove.open()
        old_us = old_after_us(glove.period_us if isinstance(glove, StreamedJoints) else None)
        if web is None:
            said = written(Guide(glove, info, hold, old_us).lead())
        else:
            from .posed_web import calibrate_on_page

            read, token = partial(raw_of, glove), token_for(web_token)
            said = calibrate_on_page(read, info, hold, old_us, wearer, web, token, written)
    finally:
        glove.close()
    echo(said)


def _written(output: Path, wearer: str, guide: "PoseGuide") -> str:
    """Write the calibration of the poses and return the line to print."""
    from thenar.runtime.files import write_atomically

    calibrated = guide.calibration(wearer)
    found = {sensor.name for sensor in calibrated.sensors}
    if not found:
        raise click.ClickException(f"no sensor moved, so nothing can be calibrated: {output} is not written")
    if left_out := [name for name in guide.names if name not in found]:
        err().print(f"Not calibrated, because they did not move: {', '.join(left_out)}", soft_wrap=True)
    write_atomically(output, calibrated.to_toml().encode("utf-8"))
    return f"{output}: {len(found)} sensors of {calibrated.subject}"


def _calibrate_taxels(glove: Path, output: Path, wearer: str, newtons: float | None, hold: float) -> None:
    from msgspec.structs import replace

    from thenar.runtime.files import write_atomically
    from thenar.runtime.harness.loading import load_harness
    from thenar.runtime.live.sources import Sources
    from thenar.runtime.scanning.ports import whole_scan
    from thenar.runtime.taxels import TaxelSettings

    keep_apart(glove, output)
    harness = replace(load_harness(glove), taxel_settings=TaxelSettings())  # it may name the file to be written
    if not harness.taxel_names:
        raise click.UsageError(f"{glove.name} names no taxels: add `taxels` to a [[stream]], or add a converter")
    _keep_stdin([stream.port for stream in harness.streams])
    with Sources(harness, (), whole_scan(harness, (), every_taxel=True)) as sources:
        calibrated = TaxelGuide(harness, sources, hold).calibration(wearer, newtons)
    if not calibrated.taxels:
        raise click.ClickException(f"no taxel moved, so nothing can be calibrated: {output} is not written")
    write_atomically(output, calibrated.to_toml().encode("utf-8"))
    echo(f"{output}: {len(calibrated.taxels)} taxels of {calibrated.subject}; name it under [taxels] of {glove.name}")


def _keep_stdin(ports: list[str]) -> None:
    """Raise UsageError if rows come from stdin, too, where the user types."""
    if "-" in ports:
        raise click.UsageError("the keys that lead a calibration come from stdin: send rows by udp: instead")


class Guide:
    """Leads through the poses on stderr, showing the sensor bytes live on a terminal; the user types the replies."""

    def __init__(
        self, glove: "CyberGlove | StreamedJoints", info: "GloveInfo | StreamedJoints", hold_s: float, old_us: int
    ) -> None:
        from thenar.runtime.posing import PoseGuide

        self._posing = PoseGuide(info.names, round(hold_s * 1e6), old_us)
        self._glove = glove
        self._console = err()
        self._typed = TypedLines(sys.stdin.fileno())
        for note in info.notes:
            self._say(note)

    def lead(self) -> "PoseGuide":
        """Return the guide once all poses are taken; each is asked for until it succeeds.

        Raises click.Abort if the user quits, DeviceError if the glove is disconnected or unplugged.
        """
        from thenar.runtime.frames import now_us
        from thenar.runtime.posing import PoseKey, PoseStage

        posing = self._posing
        while posing.stage is not PoseStage.DONE:
            if posing.stage is PoseStage.HELD:
                self._take()
                continue
            if posing.stage is PoseStage.DOUBTED:
                for problem in posing.problems:
                    self._say(f"  {problem}")
                question, other, meant = "Enter to hold it again (k: keep it anyway, q: quit)", "k", PoseKey.KEEP
            else:
                pose, number = posing.pose, f"{len(posing.taken) + 1} of {len(posing.poses)}"
                self._say(f"\nPose {number}, {pose.name}: {pose.instruction}")
                question, other, meant = (
                    "Enter when you hold it (b: back to the previous pose, q: quit)",
                    "b",
                    PoseKey.BACK,
                )
            reply = self._asked(question, other)
            if posing.silent(now_us()):
                self._say("The glove is silent: waiting until it sends.")
                while posing.silent(now_us()):
                    self._take()
            posing.press(now_us(), PoseKey.ACCEPT if reply == "" else meant)
        return posing

    def _asked(self, question: str, other: str) -> str:
        """Return "" or `other`, asking again after any other reply."""
        while (reply := self._reply(question)) not in ("", other):
            if reply == "q":
                raise click.Abort
            self._say(f"'{reply}' is not one of the keys: type one that the question names")
        return reply

    def _reply(self, question: str) -> str:
        self._say(question)
        with Live(console=self._console, transient=True, auto_refresh=False) as live:
            drawn = 0.0
            while (reply := self._typed.take()) is None:
                self._take()
                raw = self._posing.raw
                if raw is not None and self._console.is_terminal and monotonic() - drawn > _REFRESH_S:
                    live.update(self._table(raw), refresh=True)
                    drawn = monotonic()
        return reply

    def _take(self) -> None:
        from thenar.runtime.frames import now_us

        raw = raw_of(self._glove)
        if raw is not None:
            self._posing.take(now_us(), raw)

    def _table(self, raw: bytes) -> Table:
        table, posing = Table("sensor", "byte", "this pose's", ""), self._posing
        for name, byte, state in zip(posing.names, raw, posing.states(), strict=True):
            table.add_row(name, str(byte), "yes" if name in posing.pose.degrees else "", state)
        return table

    def _say(self, text: str) -> None:
        self._console.print(text, soft_wrap=True)


def raw_of(glove: "CyberGlove | StreamedJoints") -> bytes | None:
    """Return the next sensor bytes, or None if none arrive in time. Raises DeviceError."""
    timed = glove.read(_WAIT_S)
    if timed is None or isinstance(timed, bytes):
        return timed
    if timed[1].fault == "unplugged":
        from thenar.drivers.errors import DeviceError

        raise DeviceError(f"{glove.url}: the glove is not plugged into its box")
    return timed[1].sensors


class StreamedJoints:
    """The joints of the stream of a glove.toml, read as the guide reads a glove: sensor names and the bytes of a row.

    Raises UsageError if the harness has no such stream.
    """

    notes: tuple[str, ...] = ()

    def __init__(self, glove: Path, output: Path) -> None:
        from msgspec.structs import replace

        from thenar.runtime.harness.loading import load_harness
        from thenar.runtime.harness.wiring import StreamWiring
        from thenar.runtime.live.sources import Sources
        from thenar.runtime.scanning.ports import whole_scan
        from thenar.runtime.taxels import TaxelSettings

        keep_apart(glove, output)
        harness = load_harness(glove)
        device = harness.joint_device
        if not isinstance(device, StreamWiring):
            raise click.UsageError(f"{glove.name} has no [[stream]] with joints: name the port of the CyberGlove")
        alone = replace(harness, buses=(), spi=(), streams=(device,), taxel_settings=TaxelSettings())
        self.url, self.names = device.port, device.sensor_names
        self._sources = Sources(alone, (), whole_scan(alone, ()))

    def open(self) -> "StreamedJoints":
        """Wait for the first row. Raises DeviceError if none comes."""
        from thenar.drivers.errors import DeviceError

        self._sources.__enter__()
        end = monotonic() + _PATIENCE_S
        while self.read(_WAIT_S) is None:
            self._sources.raise_settings()
            if monotonic() > end:
                state = self._sources.health()[0]
                raise DeviceError(f"{state.name}: {state.error or 'no joint arrives'}; nothing is calibrated")
        return self

    def read(self, timeout_s: float) -> bytes | None:
        """Return the newest row that measures every joint."""
        from thenar.runtime.frames import GloveFrame

        arrived = self._sources.take(round(timeout_s * 1e6)).arrived
        whole = [frame.sensors for frame in arrived if isinstance(frame, GloveFrame) and 0 not in frame.sensors]
        return whole[-1] if whole else None

    @property
    def period_us(self) -> int | None:
        """The stated period of the rows."""
        return self._sources.glove_period_us

    def close(self) -> None:
        """Close the devices."""
        self._sources.__exit__(None, None, None)


class TaxelGuide:
    """Asks on stderr for a glove at rest, then for a press of every taxel, and shows the counts live."""

    def __init__(self, harness: "Harness", sources: "Sources", hold_s: float) -> None:
        self.names = harness.taxel_names
        self._sources, self._hold_s = sources, hold_s
        self._console = err()
        self._typed = TypedLines(sys.stdin.fileno())

    def calibration(self, subject: str, newtons: float | None) -> "TaxelCalibration":
        """Return the calibration. Raises DeviceError if no device sends taxels, click.Abort if the user quits."""
        from thenar.runtime.taxels import TaxelCalibration, learnt_lines

        self._meet()
        self._say("Leave every taxel alone, the hand open: press nothing.")
        self._until_enter("Enter when nothing is pressed (q: quit)", [])
        rested = self._held()
        self._say("Press every taxel once, firmly, for half a second each, in any order.")
        pressed = self._until_enter("Enter when all were pressed (q: quit)", rested)
        lines = learnt_lines(self.names, rested, pressed, 1.0 if newtons is None else newtons)
        found = {line.name for line in lines}
        if missing := [name for name in self.names if name not in found]:
            self._say(f"Not calibrated, because their counts did not move: {', '.join(missing)}")
        return TaxelCalibration(subject=subject, unit="press" if newtons is None else "N", taxels=lines)

    def _meet(self) -> None:
        """Wait for the first codes."""
        from thenar.drivers.errors import DeviceError

        end = monotonic() + _PATIENCE_S
        while not self._frames():
            self._sources.raise_settings()
            if monotonic() > end:
                states = self._sources.devices()
                wrong = next(
                    (f"{state.name}: {state.error}" for state in states if state.error), "no device sends taxels"
                )
                raise DeviceError(f"{wrong}; nothing is calibrated")

    def _frames(self) -> list[Codes]:
        from thenar.runtime.frames import SwitchFrame

        arrived = self._sources.take(_WAIT_US).arrived
        return [frame.taxels for frame in arrived if isinstance(frame, SwitchFrame) and frame.taxels is not None]

    def _held(self) -> list[Codes]:
        """Return the frames that arrive while a pose is held."""
        codes: list[Codes] = []
        end = monotonic() + self._hold_s
        while monotonic() < end or not codes:
            codes += self._frames()
        return codes

    def _until_enter(self, question: str, rested: list[Codes]) -> list[Codes]:
        """Return the frames that arrive until the user presses Enter."""
        self._say(question)
        codes: list[Codes] = []
        drawn = 0.0
        with Live(console=self._console, transient=True, auto_refresh=False) as live:
            while (reply := self._typed.take()) is None:
                codes += self._frames()
                del codes[:-_MOST_FRAMES]
                if codes and self._console.is_terminal and monotonic() - drawn > _REFRESH_S:
                    live.update(self._table(codes[-1], rested), refresh=True)
                    drawn = monotonic()
        if reply == "q":
            raise click.Abort
        return codes

    def _table(self, codes: Codes, rested: list[Codes]) -> Table:
        table = Table("taxel", "counts", "at rest")
        rest: Codes = rested[-1] if rested else (None,) * len(self.names)
        for name, code, still in zip(self.names, codes, rest, strict=True):
            table.add_row(name, *("" if count is None else str(count) for count in (code, still)))
        return table

    def _say(self, text: str) -> None:
        self._console.print(text, soft_wrap=True)


class TypedLines:
    """Whole lines from a file descriptor, read without blocking."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._rest = b""

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
