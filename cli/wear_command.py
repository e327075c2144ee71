"""`thenar wear`: record a few trials, adapt a build to them, and run it."""

import shlex
from pathlib import Path

import click

from .group import thenar
from .parameters import Number, OutputFolder, add_type_option, existing_file, existing_folder
from .printing import echo


@click.command("wear")
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.option("--glove", type=existing_file, required=True, help="The harness, a glove.toml.")
@click.option("--subject", default="me", show_default=True, help="Name of the wearer.")
@add_type_option
@click.option("--repetitions", type=click.IntRange(1), help="Trials per grasp type.  [default: 2, 3 to add a type]")
@click.option("--countdown", type=Number(0, 3600), default=3.0, show_default=True, help="Countdown, seconds.")
@click.option("--frames", metavar="N", type=click.IntRange(1), help="Stop the run after N frames.")
@click.option("-o", "--output", metavar="DIR", type=OutputFolder(), required=True, help="The wearer's build.")
def command(
    build: Path,
    glove: Path,
    subject: str,
    add_type: tuple[str, ...],
    repetitions: int | None,
    countdown: float,
    frames: int | None,
    output: Path,
) -> None:
    """Adapt BUILD to the person who wears the glove, and run it. 14 grasp types take two minutes.

    It asks for two trials of each type, and calls `thenar adapt`, `verify` and `run`. The trials are in DIR.grasps.
    However the collection ends, the same command continues it. BUILD stays as it is: to undo, run it.

    \b
    Example:
        thenar wear build/ --glove glove.toml -o mine/
        thenar run build/ --glove glove.toml    # undo
    """
    from thenar.compiler.artifact.compile import check_target

    trials = Path(f"{check_target(output)}.grasps")
    harness = ("--glove", str(glove))
    taught = [word for name in add_type for word in ("--add-type", name)]
    often = () if repetitions is None else ("--repetitions", str(repetitions))
    collected = ("--subject", subject, *taught, *often, "--countdown", str(countdown))
    some = () if frames is None else ("--frames", str(frames))
    for words in (
        ("record", "--for", str(build), *harness, *collected, "-o", str(trials)),
        ("adapt", str(build), str(trials), *taught, "-o", str(output)),
        ("verify", str(output), str(trials)),
        ("run", str(output), *harness, *some),
    ):
        echo(f"$ {shlex.join(('thenar', *words))}")
        if thenar.main(list(words), prog_name="thenar", standalone_mode=False):
            click.get_current_context().exit(1)
        if words[0] == "record":
            _check_complete(trials)


def _check_complete(trials: Path) -> None:
    """Raise click.ClickException unless every trial was accepted."""
    from thenar.runtime.recording.guide import planned, read_journal

    journal = read_journal(trials.with_suffix(".mcap"))
    assert journal.session.collection is not None
    if (total := len(planned(journal.session.collection))) > (done := len(journal.accepted)):
        raise click.ClickException(f"{done} of {total} trials are done: the same command goes on")
