"""`thenar monitor`: show the page of a recording."""

from pathlib import Path

import click

from .parameters import WEB_ADDRESS, existing_file, existing_folder, web_token_option
from .printing import say


@click.command("monitor")
@click.argument("recording", metavar="RECORDING.mcap", type=existing_file)
@click.option(
    "-b", "--build", metavar="BUILD", type=existing_folder, required=True, help="The build to score the recording with."
)
@click.option("--web", metavar="ADDRESS", default=WEB_ADDRESS, show_default=True, help="Address of the page.")
@web_token_option
def command(recording: Path, build: Path, web: str, web_token: str | None) -> None:
    """Show a recording on a page in the browser.

    The page jumps to any moment, plays from there, and shows the labels next to the predictions, the hand at that
    moment, and the other types' probabilities.

    SIGINT, SIGTERM and SIGHUP end it, with exit code 0.

    \b
    Example:
        thenar monitor run.mcap --build build/
    """
    from thenar.runtime.web.replay import ReplayPage

    from . import ended_by_signals

    with ended_by_signals() as stop, ReplayPage(recording, web, token=web_token, build=build) as page:
        say(f"thenar: the page is at {page.server.url}")
        page.run(stop)
