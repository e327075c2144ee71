"""Which mutants touch no number: those of arguments that guard (strict=) or that name a type of array (dtype, astype).

A guard that is off changes nothing until two lists disagree, which the code before it rules out; and what numpy takes
for a type where none is named is mostly the same one. Such mutants say nothing of the tests, caught or not.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

_GUARDS = {"strict", "dtype"}


class _Unguarded(ast.NodeTransformer):
    """Takes those arguments away."""

    def visit_Call(self, node: ast.Call) -> ast.Call:
        self.generic_visit(node)
        node.keywords = [keyword for keyword in node.keywords if keyword.arg not in _GUARDS]
        if isinstance(node.func, ast.Attribute) and node.func.attr == "astype":
            node.args = []
        return node


def guards_only(mutated: Path, module: str) -> Iterator[str]:
    """Yield the names of such mutants of `module`, from the source with all mutants in it that mutmut wrote."""
    functions = {node.name: node for node in ast.walk(ast.parse(mutated.read_text(encoding="utf-8")))
                 if isinstance(node, ast.FunctionDef)}  # fmt: skip
    bodies = {name: _body(function) for name, function in functions.items() if "__mutmut_" in name}
    for name, body in bodies.items():
        stem, _, number = name.rpartition("__mutmut_")
        if number.isdigit() and body == bodies.get(f"{stem}__mutmut_orig"):
            yield f"{module}.{name}"


def _body(function: ast.FunctionDef) -> str:
    return "\n".join(ast.dump(_Unguarded().visit(statement)) for statement in function.body)
