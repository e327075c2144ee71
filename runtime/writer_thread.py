"""`WriterThread`: calls that may block, carried out in order on a separate thread."""

from collections.abc import Callable
from threading import Thread

from .frames import now_us

# A call that takes longer hangs: a frozen disk, a pipe that nobody reads.
HANGING_US = 500_000
# How often closing looks whether the call under way hangs.
_LOOK_S = 0.05

Call = Callable[[], object]


class WriterThread:
    """Carries out calls in order on a separate thread: whatever they wait for delays nobody else.

    At most `limit` calls wait; one that is put then is dropped, as is one whose turn comes too late. `dropped` counts
    both. A call that raises is logged, and the next one follows.
    """

    def __init__(self, name: str, limit: int) -> None:
        from queue import SimpleQueue  # loads a library that a glove without outputs does not need

        self._limit = limit
        self._calls: SimpleQueue[tuple[int | None, Call] | None] = SimpleQueue()
        self._refused = self._late = 0
        self._since_us: int | None = None
        self._fault = ""
        self._last: Call | None = None
        self._ended = False
        self._thread = Thread(target=self._run, name=f"thenar {name}", daemon=True)
        self._thread.start()

    def put(self, call: Call, longest_us: int | None = None) -> None:
        """Carry out `call` after all earlier ones, unless it would wait for more than `longest_us`.

        Only one thread at a time may put calls.
        """
        if self._calls.qsize() >= self._limit:
            self._refused += 1
        elif not self._ended:
            self._calls.put((None if longest_us is None else now_us() + longest_us, call))

    @property
    def dropped(self) -> int:
        """The number of calls that were not carried out; once closed, with those that a hanging one holds up."""
        # The mark of the end waits as well, and counts for the call that hangs.
        left = self._calls.qsize() if self._ended and self._thread.is_alive() else 0
        return self._refused + self._late + left

    @property
    def hangs(self) -> bool:
        """Whether the call under way takes longer than half a second."""
        since_us = self._since_us
        return since_us is not None and now_us() - since_us > HANGING_US

    def close(self, last: Call | None = None) -> bool:
        """Carry out what waits, then `last`; return whether all has ended. What hangs is left to the thread."""
        if not self._ended:
            self._ended, self._last = True, last
            self._calls.put(None)
        while self._thread.is_alive() and not self.hangs:
            self._thread.join(_LOOK_S)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (waiting := self._calls.get()) is not None:
            until_us, call = waiting
            if until_us is not None and now_us() > until_us:
                self._late += 1
            else:
                self._carry_out(call)
        if self._last is not None:
            self._carry_out(self._last)

    def _carry_out(self, call: Call) -> None:
        self._since_us = now_us()
        try:
            call()
        except BaseException as reason:  # nothing may end this thread
            if (fault := f"{type(reason).__name__}: {reason}") != self._fault:
                self._fault = fault
                from logging import getLogger  # for bugs only

                getLogger("thenar").exception("%s: a bug in the program", self._thread.name)
        self._since_us = None
