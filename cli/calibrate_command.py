"""`thenar calibrate`: two points of each of a CyberGlove's sensors, pose by pose."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import output_file, serial_port
from .lines import echo

if TYPE_CHECKING:
    from thenar.drivers.calibration import GloveCalibration, Held

    from .calibrate_dialogue import Guide


def _rate(_context: click.Context, _option: click.Parameter, text: str) -> int | None:
    """Return the baud rate, None for auto."""
    if text == "auto":
        return None
    if not text.isdecimal() or not 0 < int(text) < 10**8:
        raise click.BadParameter(f"'{text}' is neither a baud rate nor auto")
    return int(text)


@click.command("calibrate")
@click.argument("port", callback=serial_port)
@click.option("-o", "--output", type=output_file, required=True, help="The calibration to write, a .toml file.")
@click.option("--subject", help="Whose hand it is; without it, the file's name.")
@click.option("--baud", callback=_rate, default="115200", show_default=True, help="Bits a second, or auto to try.")
@click.option("--sensors", type=click.Choice(["18", "22"]), help="How many the glove must have; else what it says.")
@click.option("--hold", type=click.FloatRange(min=0.05), default=1.0, show_default=True, help="Seconds to hold a pose.")
def command(port: str, output: Path, subject: str | None, baud: int | None, sensors: str | None, hold: float) -> None:
    """Calibrate the CyberGlove at PORT (/dev/ttyUSB0, socket://HOST:PORT, ...) for the hand that wears it.

    One is asked for a flat hand, a fist and five more poses, sees what the sensors say, and takes each pose with Enter.
    The file is written at the end: until then, Ctrl-C leaves an older one as it is.

    \b
    Example:
        thenar calibrate /dev/ttyUSB0 -o anna.toml
    """
    from thenar.drivers.cyberglove import CyberGlove
    from thenar.runtime.files import write_atomically
    from thenar.runtime.names import fault, shortened

    from .calibrate_dialogue import Guide

    wearer = subject or output.stem
    if reason := fault(wearer):
        raise click.UsageError(f"subject {shortened(repr(wearer))} {reason}: give another with --subject")
    glove = CyberGlove(port, baud=baud, sensors=int(sensors) if sensors else None)
    try:
        guide = Guide(glove, glove.open(), hold)
        calibrated = _calibrated(guide, wearer)
    finally:
        glove.close()
    if not calibrated.sensors:
        raise click.ClickException(f"no sensor moved, so there is nothing to calibrate by: {output} is not written")
    write_atomically(output, calibrated.to_toml().encode("utf-8"))
    echo(f"{output}: {len(calibrated.sensors)} sensors of {calibrated.subject}")


def _calibrated(guide: "Guide", subject: str) -> "GloveCalibration":
    from thenar.drivers.calibration import FLAT, POSES, calibration

    poses = (FLAT, *(pose for pose in POSES if set(pose.degrees) & set(guide.info.names)))
    taken: list[Held] = []
    while len(taken) < len(poses):
        flat = taken[0] if taken else None
        found = guide.take(poses[len(taken)], f"{len(taken) + 1} of {len(poses)}", flat)
        taken = taken[:-1] if found is None else [*taken, found]
    done = calibration(guide.info.names, taken[0], list(zip(poses[1:], taken[1:], strict=True)), subject)
    guide.report_left_out(done)
    return done
