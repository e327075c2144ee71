"""`thenar studio`: the pages of a project in the browser."""

from contextlib import suppress
from pathlib import Path
from threading import Event

import click

from .options import hand_of
from .parameters import WEB_ADDRESS, existing_folder, jobs_option, web_token_option
from .printing import say


@click.command("studio")
@click.argument("folder", metavar="[FOLDER]", type=existing_folder, default=Path())
@jobs_option()
@click.option("--web", metavar="ADDRESS", default=WEB_ADDRESS, show_default=True, help="Address of the pages.")
@web_token_option
def command(folder: Path, jobs: int, web: str, web_token: str | None) -> None:
    """Open the studio: pages in the browser that lead from the first trial to a recogniser.

    FOLDER is a project, by default the current one: its .grasps sets, recordings and builds, and the files glove.toml,
    layout.toml and prices.toml if they are there.

    SIGINT, SIGTERM and SIGHUP end it at once, what is measured or trained included, with exit code 0.

    \b
    Example:
        thenar studio
        thenar studio project/ --jobs 1
    """
    from thenar.studio import Project, open_studio

    project = Project(folder, hand_of(None))
    with suppress(KeyboardInterrupt), open_studio(project, web, token=web_token, jobs=jobs) as studio:
        say(f"thenar: the page is at {studio.server.url}")
        studio.run(Event())
