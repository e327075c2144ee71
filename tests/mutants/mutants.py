"""Draw small faults in all rooms, and count those that the tests catch.

    python tests/mutants/mutants.py FOLDER [--number 200] [--seed 1]

First the quick tests run once, with a record of the lines that each of them runs (coverage's contexts). Then each fault
is put into a copy of thenar in FOLDER, and the tests that run its line judge it, the quickest first. Prints a table by
room, and the survivors; the list of all is FOLDER/mutants.json.
"""

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue

import coverage

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("cli", "compiler", "drivers", "firmware_templates", "runtime", "simulator", "stability")
# The tests of a fault take no longer than this together, as measured without a fault; a fault that makes them five
# times as slow is caught.
_LONGEST_S, _START_S, _SLOWER = 60.0, 30.0, 5.0
_JUDGES = 2
_OTHER = {
    **{ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq},
    **{ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or, ast.Or: ast.And},
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult},
    **{ast.Mod: ast.FloorDiv, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr},
    **{ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitOr, ast.Pow: ast.Mult, ast.MatMult: ast.Mult},
}


@dataclass(slots=True)
class Mutant:
    """A fault: its file and line, and the place of its node among those of the file; `caught` is None until judged."""

    path: str
    line: int
    node: int
    change: str
    caught: bool | None = None
    tests: int = 0


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
    return child in decorators or (isinstance(parent, ast.If) and "TYPE_CHECKING" in ast.unparse(parent.test))


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
    for number, node in enumerate(nodes_of(ast.parse(path.read_text(encoding="utf-8")))):
        other = changed(node)
        if other is not None:
            now, then = (ast.unparse(each).partition("\n")[0] for each in (node, other))
            yield Mutant(str(path.relative_to(ROOT)), getattr(node, "lineno", 1), number, f"{now} -> {then}")


def drawn(number: int, seed: int) -> list[Mutant]:
    """Return `number` faults out of those of all rooms: the same for a seed and a state of the sources."""
    files = sorted(file for room in ROOMS for file in (ROOT / room).rglob("*.py"))
    found = [site for file in files for site in sites(file)]
    return sorted(random.Random(seed).sample(found, number), key=lambda mutant: (mutant.path, mutant.node))


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


def watched(folder: Path, workers: str) -> None:
    """Run the quick tests once, and record their lines and times in `folder`."""
    options = ["-m", "not slow", "-n", workers, "-q", "--cov=thenar", "--cov-context=test", "--cov-report="]
    command = [sys.executable, "-m", "pytest", *options, f"--junitxml={folder / 'times.xml'}"]
    subprocess.run(command, cwd=ROOT, env=os.environ | {"COVERAGE_FILE": str(folder / "lines")}, check=False)


class Judge:
    """The tests by the lines that they run, and their times."""

    def __init__(self, folder: Path) -> None:
        self._data = coverage.CoverageData(str(folder / "lines"))
        self._data.read()
        self._files = {str(Path(file).resolve().relative_to(ROOT)): file for file in self._data.measured_files()}
        cases = ET.parse(folder / "times.xml").getroot().iter("testcase")
        self._times: dict[tuple[str, str], float] = {
            (str(case.get("classname")), str(case.get("name"))): float(case.get("time") or 0) for case in cases
        }

    def tests_of(self, mutant: Mutant) -> tuple[list[str], float]:
        """Return the tests that judge a fault, the quickest first, and their time together."""
        if mutant.path not in self._files:
            return [], 0.0
        by_line = self._data.contexts_by_lineno(self._files[mutant.path])
        tests = {context.partition("|")[0] for context in by_line.get(mutant.line, [])} - {""}
        if not tests:  # run on import
            tests = {context.partition("|")[0] for contexts in by_line.values() for context in contexts} - {""}
        chosen, together = [], 0.0
        for seconds, test in sorted((self._time_of(test), test) for test in tests):
            together += seconds
            if together > _LONGEST_S and chosen:
                break
            chosen.append(test)
        return chosen, together

    def _time_of(self, test: str) -> float:
        path, _, name = test.partition("::")
        return self._times.get((path.removesuffix(".py").replace("/", "."), name), 1.0)

    def judge(self, mutant: Mutant, copy: Path) -> Mutant:
        """Set whether the tests catch the fault, in a copy of thenar."""
        tests, seconds = self.tests_of(mutant)
        place = copy / "thenar" / mutant.path
        place.write_text(faulty(mutant), encoding="utf-8")
        mutant.tests = len(tests)
        try:
            mutant.caught = bool(tests) and _fails(tests, copy, _START_S + _SLOWER * seconds)
        finally:
            shutil.copy(ROOT / mutant.path, place)
        return mutant


def _fails(tests: Sequence[str], copy: Path, longest_s: float) -> bool:
    options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "addopts=--import-mode=importlib"]
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", *options, *tests]
    try:
        with subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                              start_new_session=True) as process:  # fmt: skip
            try:
                return process.wait(longest_s) != 0
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, 9)
                return True
    except ProcessLookupError:
        return True


def judged(mutants: Sequence[Mutant], folder: Path) -> list[Mutant]:
    """Judge all faults, two at a time; each as soon as it is judged stands in mutants.json."""
    judge, copies = Judge(folder), SimpleQueue[Path]()
    for number in range(_JUDGES):
        copy = folder / f"copy{number}"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(ROOT / "src" / "thenar", copy / "thenar", ignore=shutil.ignore_patterns("__pycache__"))
        copies.put(copy)

    def in_a_copy(mutant: Mutant) -> Mutant:
        copy = copies.get()
        try:
            return judge.judge(mutant, copy)
        finally:
            copies.put(copy)
            (folder / "mutants.json").write_text(json.dumps([asdict(each) for each in mutants], indent=1))
            print("." if mutant.caught else "S", end="", flush=True)

    with ThreadPoolExecutor(_JUDGES) as pool:
        found = list(pool.map(in_a_copy, mutants))
    print()
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
            print(f"{mutant.path}:{mutant.line}: {mutant.change} ({mutant.tests} tests)")


def main() -> None:
    """Draw, judge and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--number", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", default="2", help="processes of the run without faults")
    given = parser.parse_args()
    folder = given.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "lines").exists():
        watched(folder, given.workers)
    report(judged(drawn(given.number, given.seed), folder))


if __name__ == "__main__":
    main()
