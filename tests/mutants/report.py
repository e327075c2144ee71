"""Say what became of mutmut's mutants, module by module, in the staged copy that is the working directory.

    python report.py tests/mutants/README.md

Survivors are listed by the line that they change, those that the page does not explain first marked as such. Ends with
1 if less than 95 % were caught.
"""

import os
import re
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from guards import guards_only

MUTMUT = Path(sys.executable).with_name("mutmut")
ENOUGH = 0.95
# A fault that sends the tests into an endless loop, or the process to its death, has been noticed.
CAUGHT = {"killed", "timeout", "segfault"}

_LINE = re.compile(r"thenar\.(?P<module>[a-z_.]+)\.(?P<name>x.*__mutmut_\d+): (?P<status>[a-z ]+)")


class Mutant(NamedTuple):
    """One fault, and what became of it."""

    module: str
    name: str
    status: str

    def change(self) -> str:
        """Return the line as the mutant has it, or the one that it lacks."""
        shown = _mutmut("show", f"thenar.{self.module}.{self.name}").splitlines()
        lines = [line for line in shown if line[:1] in "+-" and line[:3] not in ("+++", "---")]
        added = " ".join(line[1:].strip() for line in lines if line[0] == "+")
        return added or "without " + " ".join(line[1:].strip() for line in lines)


def report(page: Path) -> bool:
    """Print the table and the survivors; return whether enough were caught."""
    lines = _mutmut("results", "--all", "true").splitlines()
    every = [Mutant(*match.groups()) for line in lines if (match := _LINE.fullmatch(line.strip()))]
    left_out = {name for module in {mutant.module for mutant in every} for name in _guards_of(module)}
    mutants = [mutant for mutant in every if f"{mutant.module}.{mutant.name}" not in left_out]
    made = Counter(mutant.module for mutant in mutants)
    caught = Counter(mutant.module for mutant in mutants if mutant.status in CAUGHT)
    print(f"{'module':<36}{'mutants':>8}{'caught':>8}{'survived':>10}{'share':>8}")
    for module in sorted(made):
        _print_row(module, made[module], caught[module])
    _print_row("all", made.total(), caught.total())
    print(f"not counted: {len(every) - len(mutants)} that touch no number, but strict=, dtype= or astype's type")
    _print_survivors([mutant for mutant in mutants if mutant.status not in CAUGHT], page)
    return made.total() > 0 and caught.total() >= ENOUGH * made.total()


def _guards_of(module: str) -> set[str]:
    return set(guards_only(Path("mutants", "thenar", *module.split(".")).with_suffix(".py"), module))


def _print_row(name: str, made: int, caught: int) -> None:
    print(f"{name:<36}{made:>8}{caught:>8}{made - caught:>10}{caught / made if made else 0:>8.1%}")


def _print_survivors(survivors: list[Mutant], page: Path) -> None:
    explained = page.read_text(encoding="utf-8").splitlines()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        changes = pool.map(Mutant.change, survivors)
        for mutant, change in zip(survivors, changes, strict=True):
            entry = f"- {mutant.module}: `{change}`"
            known = "" if entry in explained else "   NOT EXPLAINED"
            print(f"{entry}{known}   ({mutant.status}: {mutant.name})")


def _mutmut(*arguments: str) -> str:
    return subprocess.run([MUTMUT, *arguments], check=True, capture_output=True, text=True).stdout


if __name__ == "__main__":
    if not report(Path(sys.argv[1])):
        sys.exit(f"less than {ENOUGH:.0%} of the mutants were caught")
