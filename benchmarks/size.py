"""What a person has to read: lines, tokens, classes and the share of docstrings of each room, of all that git tracks.

    make size

Lines are those of all source and template files, blank ones and docstrings included. Data (.toml, .svg, .json and so
on) and goldens of tests are left out. Tokens, classes and docstrings are those of Python, and the share of docstrings
is one of lines.
"""

import ast
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

PRODUCT = ("compiler", "runtime", "drivers", "firmware_templates", "simulator", "stability", "studio", "cli")
_SOURCE = {".py", ".j2", ".js", ".css", ".html", ".c", ".h", ".S", ".cpp", ".ino", ".ld", ".rs"}
_BETWEEN = {tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.COMMENT, tokenize.ENDMARKER}
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


class Size(NamedTuple):
    """Lines of all files; and of Python files their lines, tokens, classes and lines of docstrings."""

    lines: int = 0
    python: int = 0
    tokens: int = 0
    classes: int = 0
    docstrings: int = 0

    def __add__(self, other: "Size") -> "Size":  # type: ignore[override]
        return Size(*(mine + theirs for mine, theirs in zip(self, other, strict=True)))


def size_of(path: Path) -> Size:
    """Return the size of one file."""
    lines = len(path.read_bytes().splitlines())
    if path.suffix != ".py":
        return Size(lines)
    with tokenize.open(path) as file:
        tokens = sum(token.type not in _BETWEEN for token in tokenize.generate_tokens(file.readline))
    nodes = list(ast.walk(ast.parse(path.read_bytes())))
    classes = sum(isinstance(node, ast.ClassDef) for node in nodes)
    return Size(lines, lines, tokens, classes, sum(_docstring_lines(node) for node in nodes))


def _docstring_lines(node: ast.AST) -> int:
    if not isinstance(node, _DOCUMENTED) or ast.get_docstring(node, clean=False) is None:
        return 0
    first = node.body[0]
    return (first.end_lineno or first.lineno) - first.lineno + 1


def files(root: Path, room: str) -> Iterator[Path]:
    """Yield the source files of a room that git tracks."""
    tracked = subprocess.run(["git", "ls-files", "-z", room], cwd=root, capture_output=True, text=True, check=True)
    for name in filter(None, tracked.stdout.split("\0")):
        path = root / name
        if path.suffix in _SOURCE and "golden" not in path.parts and path.is_file():
            yield path


def main() -> int:
    """Print a line for each room."""
    root = Path(__file__).resolve().parents[1]
    sizes = {room: sum(map(size_of, files(root, room)), Size()) for room in (*PRODUCT, "benchmarks", "tests")}
    sizes["product"] = sum((sizes[room] for room in PRODUCT), Size())
    print(f"{'room':20}{'lines':>9}{'Python':>9}{'tokens':>10}{'a line':>8}{'classes':>9}{'docstrings':>12}")
    for room in (*PRODUCT, "product", "benchmarks", "tests"):
        size = sizes[room]
        of = max(1, size.python)
        print(
            f"{room:20}{size.lines:9,}{size.python:9,}{size.tokens:10,}{size.tokens / of:8.2f}{size.classes:9,}"
            f"{100 * size.docstrings / of:10.1f} %"
        )
    pages = [path.read_text(encoding="utf-8") for path in (root / "docs").rglob("*.md")]
    # The bars and rules of tables are no words.
    print(f"docs: {sum(len(re.sub(r'[|]|-{2,}', ' ', page).split()) for page in pages):,} words")
    return 0


if __name__ == "__main__":
    sys.exit(main())
