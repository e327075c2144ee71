"""`precisely` decorates functions whose whole body runs at 60 digits: none that hands out its work to be done later."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [*(ROOT / "stability").rglob("*.py")]


def own_nodes(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what is in a function and not in one inside it."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef | ast.Lambda):
            yield child
            yield from own_nodes(child)


def precise_functions(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and any("precisely" in ast.dump(d) for d in node.decorator_list):
            yield node


def puts_off(function: ast.FunctionDef) -> bool:
    return any(
        isinstance(node, ast.Yield | ast.YieldFrom)
        or (isinstance(node, ast.Return) and isinstance(node.value, ast.GeneratorExp))
        for node in own_nodes(function)
    )


def test_no_decorated_function_is_a_generator_or_returns_one() -> None:
    found = [(path, f) for path in SOURCES for f in precise_functions(ast.parse(path.read_text()))]
    assert len(found) > 30
    assert [f"{path}: {f.name}" for path, f in found if puts_off(f)] == []


def test_a_decorated_generator_would_be_found() -> None:
    found = list(precise_functions(ast.parse("@precisely()\ndef f():\n    yield 1")))
    assert [puts_off(function) for function in found] == [True]
