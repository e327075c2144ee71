"""`thenar monitor`: show the page of a recording."""

from pathlib import Path

import click

from .parameters import WEB_ADDRESS, existing_file, existing_folder, web_token_option
from .printing import say


@click.command("monitor")
@click.argument("recording", metavar="RECORDING.mcap", type=existing_file)
@click.option(
    "-b",
    "--build",
    "builds",
    metavar="BUILD",
    type=existing_folder,
    required=True,
    multiple=True,
    help="The build to score the recording with. Twice: to compare two builds on the same frames.",
)
@click.option("--web", metavar="ADDRESS", default=WEB_ADDRESS, show_default=True, help="Address of the page.")
@web_token_option
def command(recording: Path, builds: tuple[Path, ...], web: str, web_token: str | None) -> None:
    """Show a recording on a page in the browser.

    A timeline shows the labels, the predictions, and where they differ. The page goes to any moment, plays from there,
    and shows the hand at that moment and the other types' probabilities.

    SIGINT, SIGTERM and SIGHUP end it, with exit code 0.

    \b
    Example:
        thenar monitor run.mcap --build build/
        thenar monitor run.mcap --build build/ --build adapted/
    """
    if len(builds) > 2:
        raise click.UsageError("a page shows two builds at most: leave out a --build")
    from thenar.runtime.web.live import shell_message
    from thenar.runtime.web.replay import Replay
    from thenar.runtime.web.server import Server

    from . import ended_by_signals

    with (
        ended_by_signals() as stop,
        Replay(recording, builds) as replay,
        Server("live", web, token=web_token, on_message=replay.reply) as server,
    ):
        server.publish("shell", shell_message(recording.name, builds[0], replay.manifest))
        server.publish("replay", replay.about)
        say(f"thenar: the page is at {server.url}")
        stop.wait()
