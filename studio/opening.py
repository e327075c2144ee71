"""`open_studio`: the studio with all its pages."""

from thenar.drivers.extras import optional

from .choose import ChoosePage
from .compare import add_compare_page
from .errors import ErrorsPage
from .glove import GlovePage
from .live import StudioLive
from .project import Project
from .record import RecordPage
from .studio import Studio
from .wearer import WearerPage

with optional():  # trainers would miss it later
    import sklearn  # noqa: F401


def open_studio(project: Project, address: str, *, token: str | None, jobs: int = -1, page: str = "choose") -> Studio:
    """Return the open studio of a project, whose first page is `page`: see `Studio`."""
    studio = Studio(project, address, token=token, jobs=jobs, page=page)
    GlovePage(studio)
    RecordPage(studio, WearerPage(studio))
    ErrorsPage(studio, ChoosePage(studio))
    StudioLive(studio)
    add_compare_page(studio)
    studio.changed()
    return studio
