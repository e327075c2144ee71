"""`thenar record`: collect labelled grasps, with guidance."""

import secrets
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .parameters import (
    Number,
    OutputFile,
    add_type_option,
    check_devices,
    existing_file,
    existing_folder,
    keep_apart,
    refuse,
    seed_range,
    web_options,
)
from .printing import echo, progress, warning
from .studio_command import serve_for

if TYPE_CHECKING:
    from thenar.runtime.build import Build
    from thenar.runtime.harness.wiring import Harness
    from thenar.runtime.recording.guide import Journal
    from thenar.runtime.recording.session import Collection


_ON_PAGE = (
    "build",
    "add_type",
    "taxonomy",
    "objects",
    "repetitions",
    "countdown",
    "none",
    "seed",
    "output",
)


@click.command("record")
@click.option("--glove", type=existing_file, required=True, help="The harness, a glove.toml.")
@click.option("--for", "build", metavar="BUILD", type=existing_folder, help="Record what this build recognises.")
@add_type_option
@click.option("--taxonomy", help="kamakura14, cutkosky16, feix33 or own.  [default: kamakura14, or the build's]")
@click.option("--subject", required=True, help="Name of the subject.")
@click.option("--objects", type=existing_file, help="objects.toml: the objects for each grasp type.")
@click.option(
    "--repetitions",
    type=click.IntRange(1),
    help="Trials per grasp type.  [default: 100; for a build 2, 3 to add a type]",
)
@click.option(
    "--countdown",
    type=Number(0, 3600),
    default=3.0,
    show_default=True,
    help="Countdown before a grasp is captured, seconds.",
)
@click.option(
    "--none/--no-none",
    default=None,
    help="Also record the empty hand: open, approaching, releasing, moving idly.  [default: none, or as the build]",
)
@click.option("--seed", type=seed_range, help="Seed of the trial order.  [default: random]")
@click.option("-o", "--output", type=OutputFile(".grasps", goes_on=True), help="The .grasps file to write.")
@web_options
def command(
    glove: Path,
    build: Path | None,
    add_type: tuple[str, ...],
    taxonomy: str | None,
    subject: str,
    objects: Path | None,
    repetitions: int | None,
    countdown: float,
    none: bool | None,
    seed: int | None,
    output: Path | None,
    web: str | None,
    web_token: str | None,
) -> None:
    """Record labelled grasps: the command shows which grasp to take, in random order, with a countdown.

    The empty hand is recorded as often as each grasp type, moving for two seconds, so that a build learns when nothing
    is held; --no-none omits this. With --for, the trials are those that `thenar adapt` takes: the build's grasp types,
    twice each, with codes as the build gets them live.

    All device data goes into OUTPUT with the ending .mcap. However the collection ends, the same command continues it;
    each time it ends, all trials accepted so far are in OUTPUT.

    With --web the collection is chosen and led on the page Record of `thenar studio`, in the folder of glove.toml.

    \b
    Example:
        thenar record --glove glove.toml --subject A --objects objects.toml -o anna.grasps
        thenar record --glove glove.toml --subject me --for build/ -o mine.grasps
    """
    from thenar.compiler.recordings import check_names
    from thenar.compiler.recordings.taxonomy import collected, tasks_of
    from thenar.runtime import Build, Glove
    from thenar.runtime.harness.loading import load_harness
    from thenar.runtime.recording.guide import planned, read_journal
    from thenar.runtime.recording.session import Collection
    from thenar.studio.collecting import collect

    from . import ended_by_signals
    from .collecting import Terminal

    if web is not None:
        refuse("with --web: choose it on the page", *_ON_PAGE)
        serve_for(glove, web, web_token, "record", wearer=subject)
        return
    refuse("without --web", "web_token")
    if output is None:
        raise click.UsageError("name the .grasps file to write with --output, or record on a page with --web")
    recording = output.with_suffix(".mcap")
    keep_apart(glove, objects, output, recording)
    if output.exists() and not recording.exists():
        raise click.UsageError(f"{output} exists, but its recording {recording.name} does not: name another --output")
    _check_types(build, add_type, taxonomy, objects, none)
    harness = load_harness(glove)
    check_devices(harness, glove)
    check_names("subject", [subject])
    loaded = None if build is None else Build.load(build)
    # Glove refuses a harness that does not fit the build, and opens nothing yet.
    if loaded is not None and (lacking := Glove(loaded, harness).system.unread):
        raise click.UsageError(lacking)
    journal = None
    if recording.exists():
        with progress(f"reading {recording.name}"):
            journal = read_journal(recording)
    if loaded is not None:
        types, tasks = tasks_of(loaded.manifest, add_type)
    else:
        types, tasks = collected(taxonomy or "kamakura14", objects, _with_none(journal) if none is None else none)
    drawn = secrets.randbits(32) if seed is None else seed
    repetitions = repetitions or (100 if build is None else 3 if add_type else 2)
    checksum = "" if loaded is None else loaded.manifest.checksum
    wanted = Collection(subject, types.name, types.types, tasks, repetitions, drawn, checksum)
    if journal is not None:
        wanted = _resumed(journal, wanted, seed)
    done, total = 0 if journal is None else len(journal.accepted), len(planned(wanted))
    if done < total:
        _check_keys(harness)
        with ended_by_signals() as stop, Terminal(types, sys.stdin.fileno()) as terminal:
            done = collect(glove, wanted, recording, journal, terminal, stop, countdown)
    _write(recording, output, total, loaded, done)


def _check_keys(harness: "Harness") -> None:
    """Raise UsageError if no keys can come from stdin."""
    if sys.stdin is None:
        raise click.UsageError("stdin is closed, but a collection is led by keys typed there: run it in a terminal")
    if any(stream.port == "-" for stream in harness.streams):
        raise click.UsageError("the keys that lead a collection come from stdin: send rows by udp: instead")


def _check_types(
    build: Path | None, add_type: tuple[str, ...], taxonomy: str | None, objects: Path | None, none: bool | None
) -> None:
    """Raise UsageError if the options name grasp types in two ways, or in none."""
    if build is not None and (taxonomy is not None or objects is not None or none is not None):
        raise click.UsageError("--for takes grasp types from the build: leave out --taxonomy, --objects and --none")
    if build is None and add_type:
        raise click.UsageError("--add-type adds a grasp type to those of a build: name it with --for")
    if taxonomy == "own" and objects is None:
        raise click.UsageError("--taxonomy own takes its grasp types from an objects.toml: name it with --objects")


def _with_none(journal: "Journal | None") -> bool:
    """Return whether the empty hand is recorded, unless the user says so: as it was begun, else yes."""
    from thenar.runtime.published import NONE

    begun = None if journal is None else journal.session.collection
    return begun is None or NONE in {task.grasp for task in begun.tasks}


def _resumed(journal: "Journal", wanted: "Collection", seed: int | None) -> "Collection":
    """Return the collection to continue, which must match the one that was begun."""
    from msgspec.structs import asdict, replace

    from thenar.drivers.errors import SettingError
    from thenar.runtime.names import shortened

    begun = journal.session.collection
    assert begun is not None
    if seed is None:
        wanted = replace(wanted, seed=begun.seed)
    for name, value in asdict(wanted).items():
        if value != (before := getattr(begun, name)):
            raise SettingError(
                f"{journal.path} was begun with a different value of {name} ({shortened(str(before))}, not "
                f"{shortened(str(value))}): use the original options, or name another --output"
            )
    return wanted


def _write(recording: Path, output: Path, planned: int, build: "Build | None", accepted: int) -> None:
    """Write the set of all accepted trials, and say so."""
    from thenar.compiler.recordings.mcap_recording import import_recordings

    if not accepted:
        echo(f"no trial was accepted: {output} is not written; run the same command to continue")
        return
    with progress(f"importing {recording.name}"):
        grasp_set, report = import_recordings([recording], codings=None if build is None else build.manifest.codings)
    grasp_set.save(output)
    for finding in report.warnings:
        warning(finding.message)
    rest = "" if accepted == planned else "; run the same command to continue"
    echo(f"{output}: {grasp_set.size}; {accepted} of {planned} trials are done{rest}")
