"""Mutants of every format that thenar reads: so many, or for so long, or until Ctrl-C.

    python tests/fuzz/run.py --mutants 20000
    python tests/fuzz/run.py --minutes 60 --formats npz,mcap

With a number of mutants, the same ones come every time. By time, or with --guided, coverage guides where atheris is
installed: inputs that reach new code are kept in .fuzz/, from where the next run goes on. What fails goes into
tests/fuzz/corpus/, which every run replays first. Exits with 1 if anything failed.
"""

import argparse
import importlib.util
import os
import sys
from contextlib import nullcontext, redirect_stderr
from io import StringIO
from math import ceil
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fuzzing import Fuzzer
    from material import Format

# Before numpy is loaded: its threads would neither be counted nor forked.
os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

HERE = Path(__file__).resolve().parent
# Seconds that coverage has a format before the next one's turn.
_TURN_S = 40
# Mutants of one format before the next one's turn, by time.
_TURN = 300


def arguments() -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, help="so many in all, shared among the formats; 0: only the corpus")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="so long  [default: until Ctrl-C]")
    parser.add_argument("--formats", help="names of formats, by commas  [default: all]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant of every format")
    parser.add_argument("--plain", action="store_true", help="without coverage")
    parser.add_argument("--guided", action="store_true", help="with coverage, also so many mutants")
    parser.add_argument("--corpus", type=Path, default=HERE / "corpus")
    return parser.parse_args()


def main() -> int:
    """Run, and return the exit code."""
    asked = arguments()
    guided = asked.guided or (asked.mutants is None and not asked.plain)
    guided &= importlib.util.find_spec("atheris") is not None
    formats = _formats(asked.formats, guided)
    # Not before the formats: what is imported before cannot be instrumented any more.
    from fuzzing import Fuzzer, healthy

    for form in formats:
        healthy(form)
    fuzzer = Fuzzer(formats, asked.corpus, HERE.parents[1] / ".fuzz", asked.seed)
    began = monotonic()
    try:
        print(f"{fuzzer.replay()} inputs of the corpus replayed", flush=True)
        if asked.mutants is not None:
            share = asked.mutants / sum(form.weight for form in formats)
            for form in formats:
                count = ceil(share * form.weight)
                if guided:
                    fuzzer.guide(form, f"-runs={count}", 0)
                else:
                    fuzzer.mutate(form, asked.first, count)
        else:
            _by_time(fuzzer, asked.minutes, asked.first, guided)
    except KeyboardInterrupt:
        print("interrupted")
    return _told(fuzzer, monotonic() - began)


def _formats(names: str | None, guided: bool) -> "list[Format]":
    if guided:
        import atheris

        instrumented = atheris.instrument_imports(include=["thenar"])
    else:
        instrumented = nullcontext()
    with instrumented, redirect_stderr(StringIO()):
        import of_builds
        import of_devices
        import of_recordings
        import of_settings
        import of_tables
    rooms = (of_tables, of_builds, of_recordings, of_settings, of_devices)
    known = {form.name: form for room in rooms for form in room.FORMATS}
    wanted = list(known) if names is None else names.split(",")
    if unknown := sorted({*wanted} - {*known}):
        sys.exit(f"there is no format {unknown[0]!r}: {', '.join(known)}")
    return [known[name] for name in wanted]


def _by_time(fuzzer: "Fuzzer", minutes: float, first: int, guided: bool) -> None:
    """Give every format its turn, again and again."""
    ends, turn = monotonic() + 60 * minutes, 0
    turn_s = min(_TURN_S, max(1, round(60 * minutes / len(fuzzer.formats)))) if minutes < 600 else _TURN_S
    while monotonic() < ends:
        for form in fuzzer.formats:
            if monotonic() > ends:
                break
            before, began = fuzzer.mutants[form.name], monotonic()
            if guided:
                fuzzer.guide(form, f"-max_total_time={turn_s}", turn)
            else:
                fuzzer.mutate(form, first + turn * _TURN, _TURN)
            done = fuzzer.mutants[form.name] - before
            rate = done / (monotonic() - began)
            print(f"{form.name}: {done} mutants, {rate:.0f}/s; {len(fuzzer.failures)} failures so far", flush=True)
        turn += 1


def _told(fuzzer: "Fuzzer", seconds: float) -> int:
    for failure in fuzzer.failures.values():
        print(f"\nFAILED {failure.format}: {failure.place}\n{failure.trace}")
        if failure.numbers:
            print(f"again: python tests/fuzz/run.py {failure.numbers}")
        print(f"saved: {failure.saved or 'no, it is too large'}")
    print(", ".join(f"{name} {count}" for name, count in fuzzer.mutants.items()))
    total = sum(fuzzer.mutants.values())
    print(f"{total} mutants of {len(fuzzer.formats)} formats in {seconds:.0f} s, {len(fuzzer.failures)} failures")
    return 1 if fuzzer.failures else 0


if __name__ == "__main__":
    sys.exit(main())
