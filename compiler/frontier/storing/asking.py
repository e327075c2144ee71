"""All questions of one frontier go to one store, one set of workers and one progress."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

import msgspec

from .resuming import Asked, Effort, resumed
from .store import Store

_Task = TypeVar("_Task", bound=Asked)
_Answer = TypeVar("_Answer", bound=msgspec.Struct)


@dataclass(frozen=True, slots=True, eq=False)
class Desk:
    """Where questions are asked: `jobs` worker processes here, or those of the Dask scheduler at `cluster`."""

    store: Store
    effort: Effort
    jobs: int = -1
    cluster: str | None = None

    def here(self) -> "Desk":
        """Return the same desk, where this process does the work itself: what is measured is this machine."""
        return replace(self, jobs=1, cluster=None)

    def ask(
        self, stage: str, tasks: Iterable[_Task], work: Callable[[_Task], _Answer], answer: type[_Answer]
    ) -> dict[msgspec.Struct, _Answer]:
        """Return the answers by the keys of `tasks`, those of an earlier run from the store."""
        return resumed(
            self.store, tasks, work, answer, jobs=self.jobs, cluster=self.cluster, effort=self.effort, stage=stage
        )
