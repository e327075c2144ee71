"""Pages of a project, from its first trial to a recogniser; they train, so they need the compiler.

`open_studio` serves them. The live page and the server are in runtime/web.
"""

from .choose import ChoosePage
from .live import StudioLive
from .project import Project
from .studio import Studio

__all__ = ["Project", "Studio", "open_studio"]


def open_studio(project: Project, address: str, *, token: str | None, jobs: int = -1) -> Studio:
    """Return the open studio of a project: see `Studio`."""
    studio = Studio(project, address, token=token, jobs=jobs)
    ChoosePage(studio)
    StudioLive(studio)
    studio.changed()
    return studio
