"""`thenar doctor`: check that every device of a harness is there, and as fast as its wire allows."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.runtime.names import of_device

from .parameters import Number, OutputFile, check_devices, existing_file, existing_folder, overwrite_flag
from .printing import echo, err, json_flag, out, progress, show, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from thenar.runtime.build import Build
    from thenar.runtime.harness.wiring import Harness
    from thenar.runtime.live.checkup import CheckResult


@click.command("doctor")
@click.argument("glove", metavar="[glove.toml]", type=existing_file, required=False)
@click.option("--line", metavar="PORT", help="Listen to rows from PORT instead, and propose a glove.toml.")
@click.option("--baud", type=click.IntRange(1), default=115_200, show_default=True, help="Baud rate, with --line.")
@click.option("--seconds", type=Number(0.5, 600), default=5.0, show_default=True, help="How long to listen to --line.")
@click.option("--names", metavar="NAME,...", help="Column names, if the sender does not name them.")
@click.option("--propose", metavar="FILE.toml", type=OutputFile(".toml"), help="Write the proposal here; with --line.")
@overwrite_flag
@click.option("--build", metavar="BUILD", type=existing_folder, help="Check only the devices that this build reads.")
@json_flag
def command(
    glove: Path | None,
    line: str | None,
    baud: int,
    seconds: float,
    names: str | None,
    propose: Path | None,
    build: Path | None,
) -> None:
    """Open every device of glove.toml and report whether it is there, its speed, and the speed that its wire allows.

    With --line, listen to a board or program that sends numbers, in lines or binary frames, and show each column:
    meanwhile press every switch and pad, and bend every finger. PORT is a serial port, tcp://HOST:PORT,
    udp://HOST:PORT, ble://NAME, - (stdin), lsl:NAME, ros:/TOPIC, mqtt:HOST/TOPIC, osc:HOST:PORT/ADDRESS, or cyberglove:
    and the serial port of a CyberGlove.

    Exit code 1 if something is missing; with --build, also if the glove's calibration does not fit the build.

    \b
    Example:
        thenar doctor glove.toml --build build/
        thenar doctor --line /dev/ttyUSB0 --propose glove.toml
    """
    if (glove is None) == (line is None):
        raise click.UsageError("nothing to check: name a glove.toml, or a port to listen to with --line")
    if line is not None:
        if build is not None:
            raise click.UsageError("--build needs a glove.toml: leave out --line and name one")
        _listen(line, baud, seconds, [] if names is None else [name.strip() for name in names.split(",")], propose)
        return
    assert glove is not None
    if propose is not None or names is not None:
        raise click.UsageError("--names and --propose describe the rows of a --line: name the port with --line")
    from thenar.runtime.build import Build
    from thenar.runtime.harness.loading import load_harness
    from thenar.runtime.live.checkup import check_up
    from thenar.runtime.scanning.plan import plan_scan
    from thenar.runtime.scanning.ports import whole_scan

    harness = load_harness(glove)
    check_devices(harness, glove)
    loaded = None if build is None else Build.load(build)
    if loaded is None:
        scan = whole_scan(harness, harness.switches, every_taxel=True)
        looks = list(check_up(harness, scan, harness.switches))
    else:
        switches = [switch.name for switch in loaded.manifest.switches]
        joints = [joint.name for joint in loaded.manifest.joints]
        looks = list(check_up(harness, plan_scan(switches, harness), switches, joints))
    found = list(_calibration(harness, loaded))
    with progress("looking") as report:
        for number, look in enumerate(looks):
            found += look()
            report(number + 1, len(looks))
    show(found, _print)
    if not all(finding.present for finding in found):
        click.get_current_context().exit(1)


def _listen(port: str, baud: int, seconds: float, columns: "Sequence[str]", propose: Path | None) -> None:
    """Show what a port sends, and print the glove.toml that reads it, or write it to a file."""
    from thenar.runtime.files import write_atomically
    from thenar.runtime.harness.checks import faults
    from thenar.runtime.harness.writing import harness_to_toml
    from thenar.runtime.live.stream_probe import propose_glove

    echo(f"listening to {port} for {seconds:g} s: press every switch and pad, bend every finger", err=True)
    found = propose_glove(port, baud, seconds, columns)
    text = harness_to_toml(found.harness)

    def show_heard(_: object) -> None:
        ends = (["" if end is None else f"{end:g}" for end in (one.least, one.greatest)] for one in found.columns)
        rows = ((one.column, *pair, one.taken_for) for one, pair in zip(found.columns, ends, strict=True))
        columns = ("column", "least", "greatest", "taken for")
        err().print(table(columns, columns[1:3], f"{found.rows} rows", rows))
        for remark in found.remarks:
            err().print(of_device(port, remark))
        if propose is None and found.sensors:
            echo(text.rstrip("\n"))

    show(found, show_heard)
    if not found.sensors:
        raise click.ClickException(f"{port}: no column is a switch, a joint or a taxel, so no glove.toml is proposed")
    for _, reason in faults(found.harness):
        err().print(f"fix this before using it: {reason}")
    if propose is not None:
        write_atomically(propose, text.encode())
        err().print(f"{propose}: review it, then run `thenar doctor {propose}`")


def _calibration(harness: "Harness", build: "Build | None") -> "Iterator[CheckResult]":
    """Yield what is wrong with the joints: a calibration that does not fit would stop `thenar run` and `record`."""
    from thenar.drivers.errors import ThenarError
    from thenar.runtime.calibration import load_calibration
    from thenar.runtime.live.checkup import CheckResult
    from thenar.runtime.live.system import LiveSystem

    named = harness.calibration
    try:
        if build is not None:
            system = LiveSystem.of(build, harness)
            system.recognizer()
            if system.unread:
                yield CheckResult("joints", "", False, 0.0, None, (system.unread,))
        elif named is not None:
            load_calibration(Path(named))
    except ThenarError as wrong:
        yield CheckResult("calibration", "" if named is None else Path(named).name, False, 0.0, None, (str(wrong),))


def _print(found: "Sequence[CheckResult]") -> None:
    numbers = ("predicted µs", "measured µs")
    devices = table(("device", "part", "there", *numbers), numbers, "Devices")
    for one in found:
        measured = "" if one.measured_us is None else f"{one.measured_us:.0f}"
        there = ("slow" if one.slow else "yes") if one.present else "no"
        devices.add_row(one.device, one.part, there, f"{one.predicted_us:.0f}" if one.predicted_us else "", measured)
    out().print(devices)
    for one in found:
        for remark in one.remarks:
            out().print(of_device(f"{one.device} {one.part}".strip(), remark))
