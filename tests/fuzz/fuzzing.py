"""Mutants by the thousand, each read within its budget of time and memory; what fails is kept and replayed for ever.

A mutant may be read or refused: with a ThenarError or an OSError, within 2 s of processor time and 200 MB + 20 times
its length. All else is a failure. It is reported with the numbers that make it again, and saved in the corpus. What
takes longer is read a second time, and may then take as long as a known piece of work WORKS times over: on a slow or
busy machine that takes longer as well.
"""

import hashlib
import json
import mmap
import os
import resource
import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import FrameType
from typing import NamedTuple

from material import Format

from thenar.drivers.errors import ThenarError

CPU_S = 2.0
# So many times the reference work takes CPU_S on a machine that is idle.
WORKS = 80
# By the clock on the wall, for what no handler of Python's can end.
STUCK_S = 120
MEMORY = 200 << 20
MEMORY_A_BYTE = 20
# A larger mutant is not worth a place in the repository: the numbers make it again.
LARGEST_SAVED = 200_000

_PAGE = resource.getpagesize()
_UNLIMITED = resource.RLIM_INFINITY


class Failure(NamedTuple):
    """What a mutant did: `place` is the same for mutants that meet the same fault; `numbers` make it again."""

    format: str
    place: str
    numbers: str
    saved: str
    trace: str


class TooLongError(BaseException):
    """A mutant has used up its processor time. No handler of ordinary errors stops it."""


def healthy(form: Format) -> None:
    """Read the seeds without limits, so that all modules are loaded; what they raise is a fault of the test's."""
    with TemporaryDirectory() as folder:
        for seed in form.seeds():
            try:
                form.read(seed, Path(folder))
            except ThenarError as refusal:
                # A step may not apply to every seed: a recording without trials cannot be imported.
                if form.name not in ("mcap", "scene.toml"):
                    raise AssertionError(f"a healthy {form.name} is refused: {refusal}") from refusal


def fault(form: Format, data: bytes, folder: Path, cpu_s: float) -> tuple[str, str] | None:
    """Read `data` within its budget; return the place and the trace of what it did wrong, or None."""
    try:
        with _budget(len(data), cpu_s):
            form.read(data, folder)
    except (ThenarError, OSError) as refusal:
        if not _lacked_memory(refusal):
            return None
        return f"memory: {_place(refusal)}", _trace(refusal)
    except TooLongError as end:
        return f"time: {_place(end)}", _trace(end)
    except MemoryError as lack:
        return f"memory: {_place(lack)}", _trace(lack)
    except Exception as wrong:
        return f"{type(wrong).__name__}: {_place(wrong)}", _trace(wrong)
    return None


def reference_s() -> float:
    """Return the seconds of processor time that a fixed piece of work takes now, on this machine."""
    begun, number = time.process_time(), 0
    for step in range(400_000):
        number = (31 * number + step) & 0xFFFF
    return time.process_time() - begun


@contextmanager
def _budget(length: int, cpu_s: float) -> Iterator[None]:
    """Let what is inside have so much processor time, and so much memory more than there is now."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * _PAGE
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY + MEMORY_A_BYTE * length, _UNLIMITED))
    # Again and again: what is raised while something is being closed is lost.
    signal.setitimer(signal.ITIMER_PROF, cpu_s, 0.5)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        resource.setrlimit(resource.RLIMIT_AS, (_UNLIMITED, _UNLIMITED))


def _too_long(_number: int, _frame: FrameType | None) -> None:
    raise TooLongError


def _lacked_memory(error: BaseException | None) -> bool:
    """Return whether a refusal goes back to memory that was not there: it was asked for, though not got."""
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _place(error: BaseException) -> str:
    """Return the innermost line of thenar's on which an error came up."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "/tests/" not in frame.filename and _of_thenar(frame.filename)]
    frame = (ours or frames)[-1]
    return f"{'/'.join(Path(frame.filename).parts[-3:])}:{frame.lineno}"


def _of_thenar(filename: str) -> bool:
    return filename.startswith(str(Path(__file__).resolve().parents[2])) and "/.venv/" not in filename


def _trace(error: BaseException) -> str:
    return "".join(traceback.format_exception(error, limit=-6))[-3000:]


class Fuzzer:
    """Runs mutants in processes of their own, one format after the other, and collects what fails.

    corpus  holds a folder a format, of inputs that are replayed and mutated, and takes what fails
    grown   takes inputs that reach new code, where coverage guides
    """

    def __init__(self, formats: Sequence[Format], corpus: Path, grown: Path, seed: int) -> None:
        self.formats = formats
        self.failures: dict[str, Failure] = {}
        self.mutants: dict[str, int] = {form.name: 0 for form in formats}
        self._corpus, self._grown, self._seed = corpus, grown, seed
        # How many mutants the process at work has begun.
        self._begun = mmap.mmap(-1, 8)

    def replay(self) -> int:
        """Read every input of the corpus; return how many there are."""
        for form in self.formats:
            self._in_child(form, partial(self._replay, form))
        return sum(len(self._saved(form)) for form in self.formats)

    def mutate(self, form: Format, first: int, count: int) -> None:
        """Read the mutants of these numbers; the same numbers make the same mutants of the same corpus."""
        with self._counted(form):
            self._in_child(form, partial(self._plain, form, first, count))

    def guide(self, form: Format, limit: str, round_: int) -> None:
        """Read mutants up to libFuzzer's `limit`, and mutate again what reaches new code (atheris)."""
        with self._counted(form):
            self._in_child(form, partial(self._guided, form, limit, round_))

    @contextmanager
    def _counted(self, form: Format) -> Iterator[None]:
        """Count what a child has begun, also where Ctrl-C ends it."""
        try:
            yield
        finally:
            self.mutants[form.name] += self._count()

    def _saved(self, form: Format) -> list[Path]:
        return sorted(path for path in (self._corpus / form.name).glob("*") if path.is_file())

    def _replay(self, form: Format) -> Iterator[tuple[str, bytes]]:
        for path in self._saved(form):
            yield "", path.read_bytes()

    def _plain(self, form: Format, first: int, count: int) -> Iterator[tuple[str, bytes]]:
        pool = [*form.seeds(), *(path.read_bytes() for path in self._saved(form))]
        for number in range(first, first + count):
            random = Random(f"{form.name} {self._seed} {number}")
            data = random.choice(pool)
            for _ in range(random.choice((1, 1, 1, 2, 3))):
                data = form.mutate(data, random)
            yield f"--formats {form.name} --seed {self._seed} --first {number} --mutants 1", data

    def _in_child(self, form: Format, work: Callable[[], Iterator[tuple[str, bytes]] | None]) -> None:
        """Do `work` in a child, and take the failures that it tells of; a child that dies is one, too."""
        ear, mouth = os.pipe()
        self._set_count(0)
        child = os.fork()
        if child == 0:
            os.close(ear)
            self._live(form, work, mouth)
        os.close(mouth)
        try:
            with os.fdopen(ear) as told:
                for line in told:
                    failure = Failure(*json.loads(line))
                    self.failures.setdefault(failure.place, failure)
            _, status = os.waitpid(child, 0)
        except BaseException:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise
        if status:
            ended = f"a process ended with {os.waitstatus_to_exitcode(status)} at mutant {self._count()}"
            self.failures.setdefault(f"{form.name}: {ended}", Failure(form.name, ended, "", "", ""))

    def _live(self, form: Format, work: Callable[[], Iterator[tuple[str, bytes]] | None], mouth: int) -> None:
        """Be the child; never returns."""
        code = 70
        try:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            signal.signal(signal.SIGPROF, _too_long)
            warnings.simplefilter("ignore")
            with TemporaryDirectory() as folder:
                self._tell, self._folder = mouth, Path(folder)
                for numbers, data in work() or ():
                    signal.setitimer(signal.ITIMER_REAL, STUCK_S)
                    self.read(form, numbers, data)
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)

    def read(self, form: Format, numbers: str, data: bytes, slower: float = 1.0) -> None:
        """Read one mutant; save it, and report it, if it is the first to fail in its place.

        slower  how many times as long it may take
        """
        self._set_count(self._count() + 1)
        found = fault(form, data, self._folder, slower * CPU_S)
        if found is not None and found[0].startswith("time: "):
            found = fault(form, data, self._folder, slower * WORKS * reference_s())
        if found is None or found[0] in self.failures:
            return
        place, trace = found
        saved = self._save(form, data)
        failure = Failure(form.name, place, numbers, saved, trace)
        self.failures[place] = failure
        os.write(self._tell, json.dumps(failure).encode() + b"\n")

    def _save(self, form: Format, data: bytes) -> str:
        if len(data) > LARGEST_SAVED:
            return ""
        path = self._corpus / form.name / hashlib.sha256(data).hexdigest()[:12]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        return str(path)

    def _guided(self, form: Format, limit: str, round_: int) -> None:
        """Let libFuzzer choose what to mutate; it ends the process."""
        import atheris

        grown = self._grown / form.name
        grown.mkdir(parents=True, exist_ok=True)
        for seed in form.seeds():
            (grown / hashlib.sha256(seed).hexdigest()[:12]).write_bytes(seed)

        def one_input(data: bytes) -> None:
            # Instrumented code is several times slower.
            self.read(form, "", data, slower=5)

        def mutator(data: bytes, largest: int, seed: int) -> bytes:
            return form.mutate(data, Random(seed))[:largest]

        limits = (limit, f"-seed={self._seed + round_}", "-max_len=200000")
        ends = (f"-timeout={STUCK_S}", "-rss_limit_mb=0", "-handle_int=0", f"-artifact_prefix={self._folder}/")
        folders = [str(grown), *(str(path) for path in [self._corpus / form.name] if path.is_dir())]
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        atheris.Setup(["fuzz", *limits, *ends, *folders], one_input, custom_mutator=mutator)
        atheris.Fuzz()

    def _count(self) -> int:
        return int.from_bytes(self._begun[:], "little")

    def _set_count(self, count: int) -> None:
        self._begun[:] = count.to_bytes(8, "little")
