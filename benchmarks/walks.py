"""Count the names that a newcomer meets who follows one value through a command.

A walk starts at a parameter of a function. In every function that it enters, whatever is assigned from an expression
that holds the value is a name for it or a part of it, and is passed on wherever a call of a function of thenar has it
as an argument. The names are those of the parameters, and those of what is passed on. Each function is entered once by
each parameter. The code is read, not run: calls of methods are followed where one class alone has a method of that
name.

    .venv/bin/python benchmarks/walks.py [--names] [FOLDER]
"""

import argparse
import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOMS = ("cli", "compiler", "drivers", "firmware_templates", "runtime", "simulator", "stability")
# The first function of a flow, and the parameter that is followed.
WALKS = {
    "import": ("compiler.recordings.importer", "import_table", "table"),
    "evaluate": ("compiler.evaluation.study", "evaluate", "grasp_set"),
    "frontier": ("compiler.frontier.find", "find_frontier", "grasp_set"),
    "compile": ("compiler.artifact.compile", "compile_build", "grasp_set"),
}

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class Module:
    """Functions and classes of a module, and the homes of imported names: (module, name)."""

    functions: dict[str, Function] = field(default_factory=dict)
    classes: dict[str, dict[str, Function]] = field(default_factory=dict)
    imported: dict[str, tuple[str, str]] = field(default_factory=dict)


@dataclass
class Walk:
    """What was met: the functions, as (module, function, parameter), and the names."""

    stops: set[tuple[str, str, str]] = field(default_factory=set)
    names: set[str] = field(default_factory=set)


def modules_in(root: Path) -> dict[str, Module]:
    """Return all modules of the product under `root` by their dotted names, such as "compiler.samples"."""
    found = {}
    for room in ROOMS:
        for path in sorted((root / room).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            package = parts[:-1]
            name = ".".join(package if parts[-1] == "__init__" else parts)
            found[name] = _module(ast.parse(path.read_bytes()), package)
    return found


def _module(tree: ast.Module, package: tuple[str, ...]) -> Module:
    module = Module()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            home = ".".join([*base, *filter(None, [(node.module or "").removeprefix("thenar.")])])
            module.imported |= {name.asname or name.name: (home, name.name) for name in node.names}
    for node in tree.body:
        if isinstance(node, Function):
            module.functions[node.name] = node
        elif isinstance(node, ast.ClassDef):
            module.classes[node.name] = {each.name: each for each in node.body if isinstance(each, Function)}
    return module


class Walker:
    """Follows values through the modules."""

    def __init__(self, modules: dict[str, Module]) -> None:
        self.modules = modules
        self._methods: dict[str, list[tuple[str, Function]]] = {}
        for name, module in modules.items():
            for methods in module.classes.values():
                for method, node in methods.items():
                    self._methods.setdefault(method, []).append((name, node))

    def walk(self, module: str, function: str, parameter: str) -> Walk:
        """Return the stops and names of a walk from a parameter of a function."""
        walk, waiting = Walk(), [(module, self.modules[module].functions[function], parameter)]
        while waiting:
            home, node, name = waiting.pop()
            stop = (home, f"{node.name}:{node.lineno}", name)
            if stop not in walk.stops:
                walk.stops.add(stop)
                onwards = [*self._onwards(home, node, _names_in(node, name))]
                walk.names |= {name, *(carrier for _, _, _, carrier in onwards)}
                waiting += [each[:3] for each in onwards]
        return walk

    def _onwards(self, home: str, node: Function, names: set[str]) -> Iterator[tuple[str, Function, str, str]]:
        """Yield the functions to which calls in a function pass one of the `names`, and by which parameter."""
        for call in (each for each in ast.walk(node) if isinstance(each, ast.Call)):
            for where, callee, bound in self._callees(home, call.func, names):
                parameters = [each.arg for each in (*callee.args.posonlyargs, *callee.args.args)]
                parameters = parameters[bound:]
                for place, argument in enumerate(call.args):
                    if (carrier := _carrier(argument, names)) and place < len(parameters):
                        yield where, callee, parameters[place], carrier
                for keyword in call.keywords:
                    if keyword.arg and (carrier := _carrier(keyword.value, names)):
                        yield where, callee, keyword.arg, carrier

    def _callees(self, home: str, called: ast.expr, names: set[str]) -> Iterator[tuple[str, Function, int]]:
        """Yield the module and function of a call, and how many of its parameters are bound."""
        if isinstance(called, ast.Name):
            where, name = self.modules[home].imported.get(called.id, (home, called.id))
            module = self.modules.get(where, Module())
            if name in module.functions:
                yield where, module.functions[name], 0
            elif "__init__" in module.classes.get(name, {}):
                yield where, module.classes[name]["__init__"], 1
        elif isinstance(called, ast.Attribute) and len(self._methods.get(called.attr, ())) == 1:
            ((where, node),) = self._methods[called.attr]
            static = any(isinstance(each, ast.Name) and each.id == "staticmethod" for each in node.decorator_list)
            yield where, node, 0 if static else 1


def _carrier(argument: ast.expr, names: set[str]) -> str:
    """Return the name of which an argument is the value or a part; "" if it is none of the `names`."""
    while isinstance(argument, ast.Attribute | ast.Subscript | ast.Starred):
        argument = argument.value
    return argument.id if isinstance(argument, ast.Name) and argument.id in names else ""


def _names_in(function: Function, parameter: str) -> set[str]:
    """Return the names of the parameter's value and of its parts in a function."""
    names = {parameter}
    while True:
        before = len(names)
        for node in ast.walk(function):
            for value, targets in _bindings(node):
                if any(isinstance(each, ast.Name) and each.id in names for each in ast.walk(value)):
                    stored = (each for target in targets for each in ast.walk(target) if isinstance(each, ast.Name))
                    names |= {each.id for each in stored if isinstance(each.ctx, ast.Store)}
        if len(names) == before:
            return names - {"_"}


def _bindings(node: ast.AST) -> Iterator[tuple[ast.expr, list[ast.expr]]]:
    """Yield each value that a node binds, and the targets."""
    if isinstance(node, ast.Assign):
        yield node.value, node.targets
    elif isinstance(node, ast.For | ast.comprehension):
        yield node.iter, [node.target]
    elif isinstance(node, ast.NamedExpr | ast.AnnAssign) and node.value is not None:
        yield node.value, [node.target]


def main(arguments: list[str]) -> None:
    """Print the walks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parents[1], help="the project's folder")
    parser.add_argument("--names", action="store_true", help="print the names, too")
    asked = parser.parse_args(arguments)
    walker = Walker(modules_in(asked.folder))
    print("walk       functions  files  names")
    for title, start in WALKS.items():
        walk = walker.walk(*start)
        files, functions = {stop[0] for stop in walk.stops}, {stop[:2] for stop in walk.stops}
        print(f"{title:10}{len(functions):10}{len(files):7}{len(walk.names):7}")
        if asked.names:
            print("   ", ", ".join(sorted(walk.names)))


if __name__ == "__main__":
    main(sys.argv[1:])
