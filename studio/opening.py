"""`open_studio`: the pages of a studio, in the order of their links."""

from .choose import ChoosePage
from .collector import Collector
from .compare import add_compare_page
from .errors import ErrorsPage
from .glove import GlovePage
from .live import StudioLive
from .project import Project
from .record import RecordPage
from .studio import Studio
from .wearer import WearerPage


def open_studio(project: Project, address: str, *, token: str | None, jobs: int = -1, page: str = "choose") -> Studio:
    """Return the open studio of a project, whose first page is `page`: see `Studio`."""
    studio = Studio(project, address, token=token, jobs=jobs, page=page)
    collector = Collector(studio)
    GlovePage(studio)
    RecordPage(studio, collector)
    ErrorsPage(studio, ChoosePage(studio))
    StudioLive(studio)
    WearerPage(studio, collector)
    add_compare_page(studio)
    studio.changed()
    return studio
