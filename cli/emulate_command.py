"""`thenar emulate`: emulate a glove on real ports, playing a scene or a recording."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click
import msgspec

from thenar.drivers.names import fault

from . import SIGNALLED, ended_by_signals
from .parameters import (
    Number,
    OutputFile,
    OutputFolder,
    check_devices,
    existing_file,
    keep_apart,
    overwrite_flag,
    overwrites,
)
from .printing import echo, progress, warning

if TYPE_CHECKING:
    from thenar.runtime.harness.wiring import Harness
    from thenar.simulator.playing.bench import Bench, Cable
    from thenar.simulator.playing.performance import Log, Performance

    CableOf = Callable[[int], Cable | None]

_FRAME_US = 10_000
_HARNESS, _CALIBRATION, _TAXELS = "glove.toml", "calibration.toml", "taxels.toml"
_LONGEST_PATH = 4095  # of Linux


@click.command("emulate", context_settings={"ignore_unknown_options": True})
@click.argument("source", metavar="SCENE|FILE")
@click.argument("client", nargs=-1, type=click.UNPROCESSED, metavar="[-- COMMAND...]")
@click.option("--glove", metavar="glove.toml", type=existing_file, required=True, help="The harness to emulate.")
@click.option(
    "--dir",
    "folder",
    metavar="DIR",
    type=OutputFolder(),
    default=Path("emulated"),
    show_default=True,
    help="Folder for links to the ports, a glove.toml that names them, and the subject's calibration.",
)
@click.option("--subject", metavar="NAME", help="Subject of the scene to play.  [default: the first]")
@click.option("--period-ms", type=Number(1, 60_000), help="Time from one frame to the next.  [default: the scene's]")
@click.option(
    "--rest-ms",
    type=Number(1, 60_000),
    help="Time to rest between grasps, with an open hand.  [default: the scene's rest, or none]",
)
@click.option("--repeat", is_flag=True, help="Repeat until Ctrl-C, or until the command ends.")
@click.option("--log", metavar="FILE.jsonl", type=OutputFile(".jsonl"), help="Log the time of each frame to this file.")
@overwrite_flag
def command(
    source: str,
    client: tuple[str, ...],
    glove: Path,
    folder: Path,
    subject: str | None,
    period_ms: float | None,
    rest_ms: float | None,
    repeat: bool,
    log: Path | None,
) -> None:
    """Emulate the devices of a harness and play on them: a SCENE (a shipped one or a .toml file), a .grasps set, or the
    .mcap recording of a live run.

    A CyberGlove appears as a serial port in DIR, paced like the wire, and so do streams from serial ports, all with the
    scene's wire effects; other streams send lines on loopback, over the transport that their port names; expanders and
    converters appear on /dev/i2c-N and /dev/spidevB.C, through umockdev. A COMMAND runs next to the emulated glove and
    sees it: {glove} in its arguments is replaced by the glove.toml that names the emulated ports. It is ended when the
    playback is over.

    \b
    Example:
        thenar emulate quick --glove glove.toml --repeat
        thenar emulate continuous-rest --glove glove.toml -- thenar run build/ --glove {glove} --sink jsonl:-
    """
    from thenar.runtime.harness.loading import load_harness
    from thenar.simulator.playing.bench import Bench
    from thenar.simulator.playing.client import running

    harness = load_harness(glove)
    check_devices(harness, glove)
    calibration = None if harness.calibration is None else Path(harness.calibration)
    keep_apart(glove, Path(source), calibration, *(folder / name for name in (_HARNESS, _CALIBRATION, _TAXELS)), log)
    _check_folder(folder)
    if client and shutil.which(client[0]) is None:
        raise click.UsageError(f"{client[0]} cannot be run: no such command is installed")
    performance, cable = _performance(source, subject, period_ms, rest_ms, cyberglove=harness.cyberglove is not None)
    _warn_of_missing(source, harness, performance)
    with ExitStack() as stack:
        stop = stack.enter_context(ended_by_signals())
        folder.mkdir(parents=True, exist_ok=True)
        bench = stack.enter_context(
            Bench(
                harness,
                performance.switch_names,
                folder.resolve(),
                cable=cable,
                taxel_names=performance.taxel_names,
                joints=tuple(zip(performance.joint_names, performance.joint_units, strict=True)),
            )
        )
        emulated = _write_harness(bench, performance, folder)
        note = stack.enter_context(_noting(log))
        echo(f"emulated glove: {emulated}; run it with: thenar run BUILD --glove {emulated}", err=True)
        if bench.environment:
            settings = " ".join(f"{name}={value}" for name, value in bench.environment.items())
            echo(f"for its I2C buses, prefix that command with: {settings}", err=True)
        child = None
        if client:
            arguments = [argument.replace("{glove}", str(emulated)) for argument in client]
            try:
                child = stack.enter_context(running(arguments, {**os.environ, **bench.environment}, stop))
            except OSError as wrong:
                raise click.UsageError(f"{arguments[0]} cannot be run: {wrong.strerror}") from None
        while performance.play(bench.show, note, stop) and repeat:
            pass
    if child is not None:
        code = child.returncode
        click.get_current_context().exit(code if code >= 0 else SIGNALLED - code)


def _check_folder(folder: Path) -> None:
    """Raise UsageError if `folder` holds files with the names of ours and others too, which may then be the user's; or
    if no glove.toml could name a port in it.
    """
    if reason := fault(str(folder.resolve()), _LONGEST_PATH):
        raise click.UsageError(f"the path of {folder} {reason}, so glove.toml cannot name it: name another --dir")
    there = {path.name for path in folder.iterdir() if not path.is_symlink()} if folder.is_dir() else set()
    ours = there & {_HARNESS, _CALIBRATION, _TAXELS}
    if ours and there - ours and not overwrites(click.get_current_context()):
        raise click.UsageError(f"{folder / min(ours)} already exists: add --overwrite, or name another --dir")


def _performance(
    source: str, subject: str | None, period_ms: float | None, rest_ms: float | None, *, cyberglove: bool
) -> tuple["Performance", "CableOf"]:
    """Return the performance, and the effects on serial line n."""
    from thenar.simulator.playing import performance

    given_us, rest_us = (None if given is None else round(given * 1000) for given in (period_ms, rest_ms))
    path = Path(source)
    if path.suffix not in (".grasps", ".mcap"):
        from thenar.simulator.pipeline.scene_file import load_scene
        from thenar.simulator.playing.bench import cable_of

        scene = load_scene(source)
        with progress("simulating") as report:
            played = performance.of_scene(scene, subject, progress=report, period_us=given_us, rest_us=rest_us)
        return played, lambda line: cable_of(scene, line)
    if not path.exists():
        raise click.BadParameter(f"there is no file {path}", param_hint="SOURCE")
    if subject is not None:
        raise click.UsageError("--subject picks a subject of a scene, and a recording has only its own: leave it out")
    period_us = given_us or _FRAME_US
    if path.suffix == ".grasps":
        from thenar.compiler.recordings.graspset import GraspSet

        played = performance.of_set(GraspSet.load(path), period_us, rest_us=rest_us, cyberglove=cyberglove)
    elif rest_ms is not None:
        raise click.UsageError("--rest-ms is for scenes and sets, and a recording has its rests: leave it out")
    else:
        played = performance.of_recording(path, period_us, warning)
    return played, lambda _line: None


def _warn_of_missing(source: str, harness: "Harness", performance: "Performance") -> None:
    """Warn of inputs of the harness that the source does not have."""
    from thenar.runtime.names import list_names

    joints = [name for stream in harness.streams for name in stream.joints]
    for kind, names, known, instead in (
        ("switch", harness.switches, performance.switch_names, "open"),
        ("taxel", harness.taxel_names, performance.taxel_names, "0 counts"),
        ("joint", joints, performance.joint_names, "0"),
    ):
        if missing := [name for name in names if name not in known]:
            warning(f"{source} has no {kind} {list_names(missing)}: always {instead}")


def _write_harness(bench: "Bench", performance: "Performance", folder: Path) -> Path:
    """Write the harness that names the emulated ports, and the subject's calibrations; return the harness's path."""
    from thenar.runtime.files import write_atomically
    from thenar.runtime.harness.writing import harness_to_toml

    harness = bench.harness
    if harness.cyberglove is not None:
        write_atomically(folder / _CALIBRATION, performance.calibration.to_toml().encode())
        glove = msgspec.structs.replace(harness.cyberglove, calibration=_CALIBRATION)
        harness = msgspec.structs.replace(harness, cyberglove=glove)
    if performance.taxel_calibration is not None and harness.taxel_names:
        write_atomically(folder / _TAXELS, performance.taxel_calibration.to_toml().encode())
        settings = msgspec.structs.replace(harness.taxel_settings, calibration=_TAXELS)
        harness = msgspec.structs.replace(harness, taxel_settings=settings)
    write_atomically(folder / _HARNESS, harness_to_toml(harness).encode())
    return folder / _HARNESS


@contextmanager
def _noting(log: Path | None) -> Iterator["Log"]:
    """Yield a function that logs every frame to `log` as it is shown, one line each, with its monotonic time."""
    if log is None:
        yield lambda row, grasp, time_us: None
        return
    with log.open("wb", buffering=0) as file:

        def note(row: int, grasp: str, time_us: int) -> None:
            file.write(msgspec.json.encode({"time_us": time_us, "row": row, "grasp": grasp}) + b"\n")

        yield note
