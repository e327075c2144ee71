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
    serve(folder, web, web_token, jobs=jobs)


def serve(folder: Path, web: str, web_token: str | None, page: str = "", *, wearer: str = "", jobs: int = -1) -> None:
    """Serve the studio of a folder until it is ended, with a page first: by default the one that is next to be used."""
    from thenar.studio.opening import open_studio
    from thenar.studio.project import Project

    project = Project(folder, hand_of(None))
    if wearer:
        project.remember(wearer=wearer)
    first = page or ("choose" if project.sets() else "glove")
    with suppress(KeyboardInterrupt), open_studio(project, web, token=web_token, jobs=jobs, page=first) as studio:
        say(f"thenar: the page is at {studio.server.url}")
        studio.run(Event())


def serve_for(glove: Path, web: str, web_token: str | None, page: str, *, wearer: str = "") -> None:
    """Serve the studio of the folder of a glove.toml. Raises UsageError for a file that it would not read."""
    if glove.name != "glove.toml":
        raise click.UsageError(f"with --web the glove is the glove.toml of a project, not {glove.name}: rename it")
    serve(glove.parent, web, web_token, page, wearer=wearer)
