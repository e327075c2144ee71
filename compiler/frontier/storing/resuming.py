"""Work done once: answers from the store at once, the others found in workers and stored as they come."""

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol, TypeVar

import msgspec

from ...workers import in_workers
from .store import Store

Report = Callable[[int, int], None]


class Asked(Protocol):
    """A piece of work."""

    @property
    def key(self) -> msgspec.Struct:
        """All that the answer depends on besides the store's scope; a frozen struct, a class for each kind of work."""

    @property
    def cost(self) -> float:
        """Expected seconds on one core."""


_Task = TypeVar("_Task", bound=Asked)
_Answer = TypeVar("_Answer", bound=msgspec.Struct)


class Effort:
    """One progress over several stages: `report(done, total)`, in expected seconds of one core.

    foreseen  stages that will come, and what each will cost as far as can be told. A stage that begins says what it
              really has to do; answers that were stored are no effort, so that speed, and the time left, stay true.
    """

    def __init__(self, report: Report, foreseen: Mapping[str, float] | None = None) -> None:
        self._report = report
        self._costs = dict(foreseen or {})
        self._done = 0.0

    def foresee(self, costs: Mapping[str, float]) -> None:
        """Say what stages that have not begun will cost."""
        self._costs = {**costs, **self._costs}

    def begin(self, stage: str, cost: float) -> None:
        """Say what `stage` costs; replaces what was foreseen."""
        self._costs[stage] = cost
        self.add(0.0)

    def add(self, cost: float) -> None:
        """Say that a piece of work of this cost is done."""
        self._done += cost
        total = sum(self._costs.values())
        self._report(min(round(self._done), round(total)), round(total))


def resumed(
    store: Store,
    tasks: Iterable[_Task],
    work: Callable[[_Task], _Answer],
    answer: type[_Answer],
    *,
    jobs: int = -1,
    cluster: str | None = None,
    effort: Effort | None = None,
    stage: str = "",
) -> dict[msgspec.Struct, _Answer]:
    """Return the answers by the keys of `tasks`, in their order; equal keys are asked once.

    work     a module's own function: task -> answer, a struct of class `answer` that JSON carries without loss
    jobs, cluster  as for in_workers; the dearest tasks begin first. Answers do not depend on either.
    effort   is told of the costs, as `stage`

    Raises StoreError, whatever `work` raises, and what in_workers raises: what was found until then is stored.
    """
    asked = {task.key: task for task in tasks}
    found = {key: known for key in asked if (known := store.get(key, answer)) is not None}
    todo = sorted((task for key, task in asked.items() if key not in found), key=lambda task: -task.cost)
    effort = effort or Effort(_unheard)
    effort.begin(stage, sum(task.cost for task in todo))
    numbered = ((work, number, task) for number, task in enumerate(todo))
    for number, new in in_workers(_numbered, numbered, jobs, cluster):
        task = todo[number]
        store.put(task.key, new)
        found[task.key] = _stored(store, task.key, answer)
        effort.add(task.cost)
    return {key: found[key] for key in asked}


def _stored(store: Store, key: msgspec.Struct, kind: type[_Answer]) -> _Answer:
    # As a later run will read it: an answer that was just found is no different from one that was stored.
    answer = store.get(key, kind)
    if answer is None:
        raise TypeError(f"what was found for {key} does not read as {kind.__name__} from JSON")
    return answer


def _numbered(piece: tuple[Callable[[_Task], _Answer], int, _Task]) -> tuple[int, _Answer]:
    work, number, task = piece
    return number, work(task)


def _unheard(_done: int, _total: int) -> None:
    pass
