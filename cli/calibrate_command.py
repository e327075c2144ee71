"""`thenar calibrate`: calibrate a CyberGlove's sensors pose by pose, or taxels from rest and presses."""

import os
import select
import sys
from collections.abc import Callable, Container, Sequence
from functools import partial
from pathlib import Path
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING

import click

from thenar.drivers.closing import Closing
from thenar.drivers.names import shortened
from thenar.drivers.ports import port_fault

from .consoles import Live, Table
from .parameters import Number, OutputFile, existing_file, keep_apart, overwrite_flag, refuse, web_options
from .printing import echo, err, table
from .studio_command import serve_for

if TYPE_CHECKING:
    from thenar.drivers.calibration import GloveCalibration
    from thenar.runtime.posing import PoseGuide, PoseKey
    from thenar.runtime.taxels import TaxelCalibration
    from thenar.studio.calibrating import Codes, PressStage

_REFRESH_S = 0.1


def _device(context: click.Context, argument: click.Parameter, text: str) -> str:
    """Return the port, or the path of a glove.toml, which --taxels always expects."""
    if context.params.get("taxels") or text.endswith(".toml"):
        return str(existing_file.convert(text, argument, context))
    if fault := port_fault(text):
        raise click.BadParameter(f"{shortened(repr(text))} {fault}")
    return text


@click.command("calibrate")
@click.argument("port", metavar="PORT|glove.toml", callback=_device)
@click.option("-o", "--output", type=OutputFile(".toml"), help="The .toml file to write.")
@overwrite_flag
@click.option("--subject", help="Name of the subject.  [default: the file's name]")
@click.option("--baud", type=click.IntRange(1, 12_000_000), default=115_200, show_default=True, help="Baud rate.")
@click.option("--taxels", is_flag=True, is_eager=True, help="Calibrate the taxels of a glove.toml, not a CyberGlove.")
@click.option("--newtons", type=Number(0.001, 1000), help="Force of the presses, if known; with --taxels.")
@click.option("--hold", type=Number(0.05, 60), default=1.0, show_default=True, help="Time to hold each pose, seconds.")
@web_options
def command(
    port: str,
    output: Path | None,
    subject: str | None,
    baud: int,
    taxels: bool,
    newtons: float | None,
    hold: float,
    web: str | None,
    web_token: str | None,
) -> None:
    """Calibrate the CyberGlove at PORT (/dev/ttyUSB0, socket://HOST:PORT, ...) for its wearer. Given a glove.toml,
    calibrate its joints, or its taxels with --taxels.

    The command asks for a flat hand, a fist and five more poses, shows the sensor values, and takes each pose when you
    press Enter. For taxels, leave all untouched first, then press each one once. The file is written at the end; until
    then, Ctrl-C keeps the old one.

    With --web, the page Glove of `thenar studio` leads through it, and names the file in glove.toml.

    \b
    Example:
        thenar calibrate /dev/ttyUSB0 -o anna.toml
        thenar calibrate glove.toml --taxels -o pads.toml
        thenar calibrate glove.toml -o anna.toml
    """
    from thenar.runtime.harness.loading import load_harness
    from thenar.runtime.names import fault
    from thenar.studio.calibrating import lead_poses, lead_presses

    if web is not None:
        refuse("with --web", "output", "baud", "taxels", "newtons", "hold")
        serve_for(Path(port), web, web_token, "glove", wearer=subject or "")
        return
    refuse("without --web", "web_token")
    if output is None:
        raise click.UsageError("name the .toml file to write with --output, or calibrate on a page with --web")
    wearer = subject or output.stem
    if reason := fault(wearer):
        raise click.UsageError(f"subject {shortened(repr(wearer))} {reason}: give another with --subject")
    if newtons is not None and not taxels:
        raise click.UsageError("--newtons is the force of presses on taxels: add --taxels")
    if port.endswith(".toml"):
        keep_apart(Path(port), output)
    if port.endswith(".toml") and "-" in [stream.port for stream in load_harness(port).streams]:
        raise click.UsageError("the keys that lead a calibration come from stdin: send rows by udp: instead")
    with TypedLines(sys.stdin.fileno()) as typed:
        if taxels:
            pressed = lead_presses(Path(port), hold, partial(_ask_press, typed), Event(), wearer, newtons)
            assert pressed is not None
            names, pads = pressed
            said = _written(output, "taxel", [line.name for line in pads.sensors], names, pads)
            echo(f"{said}; name it under [taxels] of {Path(port).name}")
            return
        guide = lead_poses(port, baud, hold, _asking_poses(typed), Event(), partial(echo, err=True))
    assert guide is not None
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


def _asking_poses(typed: "TypedLines") -> "Callable[[PoseGuide], list[PoseKey]]":
    """Return the view that asks for each pose on stderr until it succeeds, showing the bytes live on a terminal."""
    from thenar.runtime.frames import now_us

    waiting: list[PoseKey] = []

    def ask(guide: "PoseGuide") -> "list[PoseKey]":
        if guide.stage in ("held", "done"):
            return []
        silent = guide.silent(now_us())
        if waiting:
            return [] if silent else [waiting.pop()]

        def drawn() -> Table:
            shown = table(("sensor", "byte", "this pose's", ""))
            for name, byte, state in zip(guide.names, guide.raw or b"", guide.states(), strict=False):
                shown.add_row(name, str(byte), "yes" if name in guide.pose.degrees else "", state)
            return shown

        keys: dict[str, PoseKey]
        if guide.stage == "doubted":
            lines = [f"  {problem}" for problem in guide.problems]
            question, keys = "Enter to hold it again (k: keep it anyway, q: quit)", {"k": "keep"}
        else:
            number = f"{len(guide.taken) + 1} of {len(guide.poses)}"
            lines = [f"\nPose {number}, {guide.pose.name}: {guide.pose.instruction}"]
            question, keys = "Enter when you hold it (b: back to the previous pose, q: quit)", {"b": "back"}
        reply = typed.ask([*lines, question], keys, drawn)
        if reply is None:
            return []
        if silent:
            echo("The glove is silent: waiting until it sends.", err=True)
            waiting.append(keys.get(reply, "accept"))
            return []
        return [keys.get(reply, "accept")]

    return ask


def _ask_press(
    typed: "TypedLines", stage: "PressStage", names: "Sequence[str]", counts: "Codes", rested: "Codes"
) -> bool:
    """Ask on stderr for a glove at rest, then for a press of every taxel, and show the counts live on a terminal."""
    from thenar.studio.calibrating import PRESS_WORDS

    def drawn() -> Table:
        shown = table(("taxel", "counts", "at rest"))
        for name, *found in zip(names, counts, rested, strict=True):
            shown.add_row(name, *("" if count is None else str(count) for count in found))
        return shown

    what = {"untouched": "nothing is pressed", "pressing": "all were pressed"}.get(stage)
    if what is None:
        return False
    return typed.ask([PRESS_WORDS[stage], f"Enter when {what} (q: quit)"], (), drawn) is not None


class TypedLines(Closing):
    """Whole lines from a file descriptor, read without blocking, in reply to questions on stderr; a context manager."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._rest = b""
        self._live: Live | None = None
        self._shown_s, self._refused = 0.0, False

    def close(self) -> None:
        """Leave the terminal as it was."""
        if self._live is not None:
            self._live.close()
        self._live = None

    def ask(self, question: Sequence[str], replies: Container[str], drawn: Callable[[], Table]) -> str | None:
        """Return "" or one of the `replies`, None while nothing was typed. The lines of a question are printed once
        until there is a reply; meanwhile a terminal shows what is `drawn`. Raises click.Abort for a q.
        """
        if self._live is None:
            for line in question[-1:] if self._refused else question:
                echo(line, err=True)
            self._live, self._refused = Live(err()), False
        reply = self.take()
        if reply is None:
            if err().is_terminal and monotonic() - self._shown_s > _REFRESH_S:
                self._live.update(drawn())
                self._shown_s = monotonic()
            return None
        self.close()
        if reply == "q":
            raise click.Abort
        if reply and reply not in replies:
            echo(f"'{reply}' is not one of the keys: type one that the question names", err=True)
            self._refused = True
            return None
        return reply

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
