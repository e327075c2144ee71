"""`open_studio`: the pages of a studio, in the order of their links."""

from thenar.drivers.extras import optional

from .choose import ChoosePage
from .collector import Collector
from .compare import add_compare_page
from .errors import ErrorsPage
from .glove import GlovePage
from .project import Project
from .record import RecordPage
from .studio import Studio
from .wearer import WearerPage

with optional():  # trainers would miss it later
    import sklearn  # noqa: F401


def open_studio(project: Project, address: str, *, token: str | None, jobs: int = -1, page: str = "choose") -> Studio:
    """Return the open studio of a project, whose first page is `page`: see `Studio`."""
    studio = Studio(project, address, token=token, jobs=jobs, page=page)
    collector = Collector(studio)
    GlovePage(studio)
    RecordPage(studio, collector)
    ErrorsPage(studio, ChoosePage(studio))
    WearerPage(studio, collector)
    add_compare_page(studio)
    studio.changed()
    return studio
