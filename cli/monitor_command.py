"""`thenar monitor`: show the page of a run elsewhere, or of a recording."""

from pathlib import Path

import click

from .parameters import WEB_ADDRESS, existing_file, existing_folder, web_token_option
from .printing import echo, say_page


@click.command("monitor")
@click.argument("source", metavar="ADDRESS|RECORDING")
@click.option(
    "-b",
    "--build",
    metavar="BUILD",
    type=existing_folder,
    help="The build used by that run, or to score the recording with.",
)
@click.option("--web", metavar="ADDRESS", default=WEB_ADDRESS, show_default=True, help="Address of the page.")
@web_token_option
def command(source: str, build: Path | None, web: str, web_token: str | None) -> None:
    """Show a run elsewhere, or a recording, on a page in the browser.

    ADDRESS is where that run publishes: tcp:HOST:PORT or unix:PATH, as in its --sink. With ?detail there and --build
    here, the page also shows switches, joints and the probabilities of all types. A lost connection is reopened.

    RECORDING is an .mcap file: the page jumps to any moment, plays from there, and shows the labels next to the
    predictions; with --build also the hand at that moment, and the other types' probabilities.

    SIGINT, SIGTERM and SIGHUP end it, with exit code 0.

    \b
    Example:
        thenar run build/ --glove glove.toml --sink "unix:/tmp/grasps?detail" --status
        thenar monitor unix:/tmp/grasps --build build/
        thenar monitor run.mcap --build build/
    """
    from thenar.runtime.web.monitor import StreamMonitor

    from . import ended_by_signals

    if Path(source).is_file() or source.endswith(".mcap"):
        from thenar.runtime.web.replay import ReplayPage

        path = existing_file.convert(source, None, None)
        with ended_by_signals() as stop, ReplayPage(path, web, token=web_token, build=build) as page:
            say_page(page.server.url)
            page.run(stop)
        return
    with ended_by_signals() as stop, StreamMonitor(source, web, token=web_token, build=build) as monitor:
        say_page(monitor.server.url)
        monitor.run(stop, lambda source: echo(source.error or f"{source.where}: connected", err=True))
