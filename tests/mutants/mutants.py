"""Draw small faults in all rooms, and count those that the tests catch.

    python tests/mutants/mutants.py FOLDER [--number 200] [--seed 1]
    python tests/mutants/mutants.py FOLDER --again OTHER/mutants.json

Each fault is put into a copy of thenar in FOLDER, and the quick tests that are nearest to it judge it: those that
import its module, then those that import a module that does, and so on. A test that also fails without the fault
catches nothing. Prints a table by room, and the survivors; the list of all, each with the test that caught it, is
FOLDER/mutants.json. With --again, the faults of that list are judged, as far as their lines are the same here: to
compare the tests of two commits.
"""

import argparse
import ast
import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("cli", "compiler", "drivers", "firmware_templates", "runtime", "simulator", "stability")
# A fault is caught within this time, or counts as a survivor; and by at most so many files of tests.
_LONGEST_S, _MOST_FILES = 60.0, 12
_JUDGES = 2
_OTHER: dict[type[ast.AST], Any] = {
    **{ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq},
    **{ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or, ast.Or: ast.And},
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult},
    **{ast.Mod: ast.FloorDiv, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr},
    **{ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitOr, ast.Pow: ast.Mult, ast.MatMult: ast.Mult},
}


@dataclass(slots=True)
class Mutant:
    """A fault: its file and line, and the place of its node among those of the file; `caught` is the test that failed,
    "" if none did, None until it is judged.
    """

    path: str
    line: int
    node: int
    text: str
    change: str
    caught: str | None = None


def nodes_of(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes that may be changed, in order: none in annotations, messages of errors, or imports for types."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += reversed([child for child in ast.iter_child_nodes(node) if not _left_out(node, child)])


def _left_out(parent: ast.AST, child: ast.AST) -> bool:
    if isinstance(child, ast.Raise | ast.Import | ast.ImportFrom | ast.arguments):
        return True
    if isinstance(child, ast.keyword) and child.arg in ("strict", "dtype"):
        return True
    if child in (getattr(parent, "annotation", None), getattr(parent, "returns", None)):
        return True
    decorators = getattr(parent, "decorator_list", ())
    return child in decorators or (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test))


def changed(node: ast.AST) -> ast.AST | None:
    """Return the node with its fault; None for a node without one."""
    match node:
        case ast.Compare(left, [op], [right]):
            return ast.Compare(left, [_OTHER[type(op)]()], [right])
        case ast.BinOp(left, op, right):
            return ast.BinOp(left, _OTHER[type(op)](), right)
        case ast.BoolOp(op, values):
            return ast.BoolOp(_OTHER[type(op)](), values)
        case ast.UnaryOp(ast.Not() | ast.USub(), operand):
            return operand
        case ast.Constant(bool() as value):
            return ast.Constant(not value)
        case ast.Constant(int() as value):
            return ast.Constant(value + 1)
        case ast.Expr(ast.Call()) | ast.AugAssign():
            return ast.Pass()
        case ast.If(ast.Name() | ast.Attribute() | ast.Call() as test, body, orelse):
            return ast.If(ast.UnaryOp(ast.Not(), test), body, orelse)
    return None


def sites(path: Path) -> Iterator[Mutant]:
    """Yield all faults of a file."""
    source = path.read_text(encoding="utf-8")
    lines = source.splitlines()
    for number, node in enumerate(nodes_of(ast.parse(source))):
        other = changed(node)
        if other is not None:
            now, then = (ast.unparse(each).partition("\n")[0] for each in (node, other))
            line = getattr(node, "lineno", 1)
            yield Mutant(str(path.relative_to(ROOT)), line, number, lines[line - 1].strip(), f"{now} -> {then}")


def drawn(number: int, seed: int) -> list[Mutant]:
    """Return `number` faults out of those of all rooms: the same for a seed and a state of the sources."""
    files = sorted(file for room in ROOMS for file in (ROOT / room).rglob("*.py"))
    found = [site for file in files for site in sites(file)]
    return sorted(random.Random(seed).sample(found, number), key=lambda mutant: (mutant.path, mutant.node))


def again(listed: Path) -> list[Mutant]:
    """Return the faults of a list that are possible here: in the same file, a line of the same text."""
    found = []
    for old in json.loads(listed.read_text(encoding="utf-8")):
        path = ROOT / old["path"]
        same = (
            [one for one in sites(path) if (one.text, one.change) == (old["text"], old["change"])]
            if path.exists()
            else []
        )
        if same:
            found.append(min(same, key=lambda one: abs(one.line - old["line"])))
    return found


class _Change(ast.NodeTransformer):
    def __init__(self, node: ast.AST) -> None:
        self._node = node

    def visit(self, node: ast.AST) -> ast.AST:
        return changed(node) or node if node is self._node else self.generic_visit(node)


def faulty(mutant: Mutant) -> str:
    """Return the text of its file with a fault."""
    tree = ast.parse((ROOT / mutant.path).read_text(encoding="utf-8"))
    node = list(nodes_of(tree))[mutant.node]
    return ast.unparse(ast.fix_missing_locations(_Change(node).visit(tree)))


class Nearest:
    """The files of tests by their distance from a module, in imports."""

    def __init__(self) -> None:
        self._importers: dict[str, set[str]] = {}
        self._tests: dict[str, set[str]] = {}
        for room in ROOMS:
            for file in (ROOT / room).rglob("*.py"):
                for name in _imported(file, _module(file)):
                    self._importers.setdefault(name, set()).add(_module(file))
        for file in (ROOT / "tests").rglob("test_*.py"):
            for source in (file, file.with_name("conftest.py")):
                for name in _imported(source, "") if source.exists() else ():
                    self._tests.setdefault(name, set()).add(str(file.relative_to(ROOT)))

    def tests_of(self, path: str) -> list[str]:
        """Return the files of tests that are nearest to the module at `path`; of equally near ones, those named like it
        first, then those with the fewest bytes.
        """
        stem = Path(path).stem
        module = _module(ROOT / path)
        chosen, seen = dict[str, None](), {module}
        ring = set(seen)
        while ring and len(chosen) < _MOST_FILES:
            tests = {test for each in ring for test in self._tests.get(each, ())}
            chosen |= dict.fromkeys(
                sorted(tests, key=lambda test: (stem not in test, (ROOT / test).stat().st_size, test))
            )
            # Registries and commands import their members by name: by their package.
            ring = {name for each in ring for name in self._importers.get(each, ())} - seen
            ring |= {module.rpartition(".")[0]} - seen
            seen |= ring
        return list(chosen)[:_MOST_FILES]


def _module(file: Path) -> str:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(("thenar", *(parts[:-1] if parts[-1] == "__init__" else parts)))


def _imported(file: Path, module: str) -> Iterator[str]:
    """Yield the modules of thenar that a file imports, late imports included."""
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("thenar"))
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            name = ".".join([*above, *([node.module] if node.module else [])])
            if name.startswith("thenar"):
                yield name
                yield from (f"{name}.{alias.name}" for alias in node.names)


def judge(mutant: Mutant, copy: Path, nearest: Nearest) -> Mutant:
    """Set whether the nearest tests catch the fault, in a copy of thenar."""
    place = copy / "thenar" / mutant.path
    place.write_text(faulty(mutant), encoding="utf-8")
    try:
        tests = nearest.tests_of(mutant.path)
        mutant.caught = next(iter(_failed(tests, copy, _LONGEST_S)), "") if tests else ""
    finally:
        shutil.copy(ROOT / mutant.path, place)
    return mutant


def _failed(tests: Sequence[str], copy: Path, longest_s: float | None = None) -> list[str]:
    """Return the tests that fail: the first one if there is a longest time, otherwise all."""
    options = [
        "-q",
        "-rfE",
        "-m",
        "not slow",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        *(["-x"] if longest_s else []),
    ]
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1", "THENAR_MUTATED": "1"}
    command = [sys.executable, "-m", "pytest", *options, *tests]
    with subprocess.Popen(
        command,
        cwd=ROOT,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        text=True,
    ) as process:
        try:
            said, _ = process.communicate(timeout=longest_s)
        except subprocess.TimeoutExpired:
            return []
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    named = [
        line.split(" - ")[0].partition(" ")[2] for line in said.splitlines() if line.startswith(("FAILED ", "ERROR "))
    ]
    return named or (["pytest itself"] if process.returncode else [])


def judged(mutants: Sequence[Mutant], folder: Path) -> list[Mutant]:
    """Judge all faults, two at a time; each as soon as it is judged stands in mutants.json."""
    nearest, copies = Nearest(), SimpleQueue[Path]()
    for number in range(_JUDGES):
        copy = folder / f"copy{number}"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(ROOT / "src" / "thenar", copy / "thenar", ignore=shutil.ignore_patterns("__pycache__"))
        copies.put(copy)

    def in_a_copy(mutant: Mutant) -> Mutant:
        copy = copies.get()
        try:
            return judge(mutant, copy, nearest)
        finally:
            copies.put(copy)
            (folder / "mutants.json").write_text(json.dumps([asdict(each) for each in mutants], indent=1))
            print("." if mutant.caught else "S", end="", flush=True)

    with ThreadPoolExecutor(_JUDGES) as pool:
        found = list(pool.map(in_a_copy, mutants))
    print()
    judges = sorted({mutant.caught.partition("[")[0] for mutant in found if mutant.caught and "::" in mutant.caught})
    failing = set(_failed(judges, copies.get())) if judges else set()
    for mutant in found:
        if mutant.caught in failing:
            mutant.caught = ""
    (folder / "mutants.json").write_text(json.dumps([asdict(each) for each in found], indent=1))
    return found


def report(mutants: Sequence[Mutant]) -> None:
    """Print the table by room, and the survivors."""
    made = Counter(mutant.path.partition("/")[0] for mutant in mutants)
    caught = Counter(mutant.path.partition("/")[0] for mutant in mutants if mutant.caught)
    print(f"{'room':<20}{'drawn':>7}{'caught':>8}")
    for room in (*sorted(made), "all"):
        several = (made.total(), caught.total()) if room == "all" else (made[room], caught[room])
        print(f"{room:<20}{several[0]:>7}{several[1]:>8}")
    for mutant in mutants:
        if not mutant.caught:
            print(f"{mutant.path}:{mutant.line}: {mutant.change}")


def main() -> None:
    """Draw, judge and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--number", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--again", type=Path, metavar="LIST", help="judge the faults of this list")
    given = parser.parse_args()
    folder = given.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    report(judged(again(given.again) if given.again else drawn(given.number, given.seed), folder))


if __name__ == "__main__":
    main()
