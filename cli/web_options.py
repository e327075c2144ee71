"""The options of commands that serve a page, and the messages about it."""

import click

from .common import Command, err

HERE = "127.0.0.1:8080"

web_token_option = click.option(
    "--web-token",
    is_flag=True,
    help="Show the page only to those with its full address; required if other machines can reach it.",
)


def web_options(command: Command) -> Command:
    """Add --web and --web-token, whose values the command takes as `web` (None: no page) and `web_token`."""
    option = click.option(
        "--web",
        is_flag=False,
        flag_value=HERE,
        metavar="[ADDRESS]",
        help=f"Show a page in the browser.  [{HERE}]",
    )
    return option(web_token_option(command))


def token_for(web_token: bool) -> str | None:
    """Return a new token for a page, or None if it needs none."""
    from thenar.runtime.web.guard import new_token

    return new_token() if web_token else None


def say_page(url: str) -> None:
    """Print the address of the page."""
    err().print(f"thenar: the page is at {url}", soft_wrap=True)
