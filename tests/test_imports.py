"""Imports run one way between the rooms of the house (docs/project/architecture.md), read off the sources."""

import ast
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("cli", "compiler", "drivers", "firmware_templates", "runtime", "simulator", "stability", "studio")

# What modules whose name starts with the key may import of ours; the longest key that fits counts.
ALLOWED = {
    "drivers": ("drivers",),
    "firmware_templates": (),
    "runtime": ("runtime", "drivers"),
    "runtime.model": ("runtime.errors", "runtime.sealed", "runtime.model", "drivers.members"),
    "runtime.errors": ("drivers.errors",),
    "compiler": ("runtime", "drivers.errors", "compiler"),
    "compiler.frontier": ("runtime", "drivers", "compiler"),
    "compiler.arrays": ("runtime.errors",),
    "compiler.pictures": ("runtime.errors",),
    "compiler.elementary": (),
    "compiler.text": (),
    "compiler.wearer": ("runtime", "drivers.errors", "compiler.elementary"),
    "compiler.workers": ("drivers.errors",),
    "compiler.hand": ("drivers.errors", "runtime"),
    "compiler.publication": ("runtime.files", "drivers.errors"),
    "compiler.recordings": (
        "runtime",
        "drivers.errors",
        "compiler.arrays",
        "compiler.recordings",
        "compiler.pictures",
        "compiler.publication",
        "compiler.text",
    ),
    "compiler.samples": (
        "runtime",
        "drivers.errors",
        "compiler.arrays",
        "compiler.artifact",
        "compiler.recordings",
        "compiler.text",
    ),
    "compiler.placement": (
        "runtime",
        "drivers.cyberglove_protocol",
        "drivers.errors",
        "drivers.members",
        "compiler.elementary",
        "compiler.facts",
        "compiler.glove.propose",
        "compiler.pictures",
        "compiler.placement",
        "compiler.recordings",
        "compiler.samples",
        "compiler.model",
        "compiler.text",
        "compiler.trainers",
        "compiler.workers",
    ),
    "compiler.model": ("runtime", "drivers.errors", "compiler.elementary", "compiler.model", "compiler.trainers"),
    "compiler.trainers": (
        "runtime",
        "drivers.errors",
        "drivers.members",
        "compiler.elementary",
        "compiler.samples",
        "compiler.trainers",
        "compiler.workers",
    ),
    "compiler.firmware": (
        "runtime",
        "drivers",
        "compiler.elementary",
        "compiler.firmware",
        "compiler.publication",
        "compiler.model",
        "firmware_templates",
    ),
    "compiler.glove": (
        "runtime",
        "drivers",
        "compiler.facts",
        "compiler.hand",
        "compiler.publication",
        "compiler.recordings.graspset",
        "compiler.text",
        "compiler.glove",
    ),
    "compiler.evaluation": (
        "runtime",
        "drivers.errors",
        "compiler.recordings",
        "compiler.placement",
        "compiler.elementary",
        "compiler.pictures",
        "compiler.samples",
        "compiler.model",
        "compiler.text",
        "compiler.trainers",
        "compiler.workers",
        "compiler.evaluation",
    ),
    "simulator.body": (
        "drivers.cyberglove_protocol",
        "compiler.elementary",
        "compiler.recordings",
        "simulator.streams",
        "simulator.body",
    ),
    "simulator.handmaps": (
        "runtime.names",
        "compiler.elementary",
        "compiler.hand",
        "compiler.recordings",
        "compiler.pictures",
        "simulator.body",
        "simulator.handmaps",
    ),
    "simulator": (
        "runtime",
        "drivers",
        "compiler.hand",
        "compiler.recordings",
        "compiler.elementary",
        "compiler.pictures",
        "compiler.workers",
        "simulator",
    ),
    "stability": ("compiler", "drivers", "runtime", "simulator", "stability"),
    "stability.reference": ("stability.reference",),
    "studio": ("compiler", "drivers", "runtime", "studio"),
    "cli": PACKAGES,
}

# Third-party packages of the extras `compiler` and `stability`, and of peers: a board has none.
WORKSTATION_ONLY = {
    "sklearn",
    "scipy",
    "matplotlib",
    "joblib",
    "threadpoolctl",
    "mpmath",
    "jinja2",
    "clevercsv",
    "python_calamine",
    "pyarrow",
    "h5py",
}


def sources() -> dict[str, Path]:
    """Return path by name of every module."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT / package).with_suffix("").parts
            found[".".join([package, *parts]).removesuffix(".__init__")] = path
    return found


SOURCES = sources()
Import = ast.Import | ast.ImportFrom


def statements(body: Sequence[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield statements and those inside them: no expression holds an import."""
    for node in body:
        yield node
        for part in ("body", "orelse", "finalbody"):
            yield from statements(getattr(node, part, ()))
        for branch in (*getattr(node, "handlers", ()), *getattr(node, "cases", ())):
            yield from statements(branch.body)


@cache
def tree_of(name: str) -> ast.Module:
    return ast.parse(SOURCES[name].read_text())


@cache
def imports_in(name: str) -> list[Import]:
    return [node for node in statements(tree_of(name).body) if isinstance(node, Import)]


def resolve(name: str, is_package: bool, node: ast.ImportFrom) -> str:
    """Return what a `from ... import` of module `name` names; modules of ours by their path in the repository."""
    if not node.level:
        return (node.module or "").removeprefix("thenar.")
    parts = name.split(".") if is_package else name.split(".")[:-1]
    base = parts[: len(parts) - node.level + 1]
    return ".".join([*base, *(node.module or "").split(".")]).strip(".")


def imports(name: str, nodes: Iterable[Import]) -> Iterator[str]:
    is_package = SOURCES[name].name == "__init__.py"
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name.removeprefix("thenar.") for alias in node.names)
        else:
            yield resolve(name, is_package, node)


def fits(name: str, rooms: tuple[str, ...]) -> bool:
    return any(name == room or name.startswith(room + ".") for room in rooms)


def faults_of(name: str) -> Iterator[str]:
    """Yield what a module imports that its room may not, and imports that are written in the wrong way."""
    room = max((key for key in ALLOWED if fits(name, (key,))), key=len)
    ours = {imported for imported in imports(name, imports_in(name)) if imported.split(".")[0] in (*PACKAGES, "thenar")}
    for imported in sorted(ours):
        if not fits(imported, (*ALLOWED[room], "drivers.extras", name)):
            yield f"{name} imports {imported}, which {room} may not"
    depth = len(name.split(".")) - (SOURCES[name].name != "__init__.py")
    for node in imports_in(name):
        if isinstance(node, ast.ImportFrom):
            if node.level > depth:
                yield f"{name}, line {node.lineno} leaves the room: write from thenar."
            if fits(node.module or "", (f"thenar.{name.split('.')[0]}",)):
                yield f"{name}, line {node.lineno}: write from ."


def test_modules_import_only_what_their_room_may() -> None:
    assert [fault for name in SOURCES for fault in faults_of(name)] == []


def test_the_boards_side_names_no_workstation_package_at_the_top() -> None:
    wrong = []
    for name in SOURCES:
        if fits(name, ("runtime", "drivers", "cli", "compiler.recordings", "compiler.wearer")):
            top = [node for node in tree_of(name).body if isinstance(node, Import)]
            packages = WORKSTATION_ONLY & {imported.split(".")[0] for imported in imports(name, top)}
            wrong += [f"{name} imports {package}" for package in sorted(packages)]
    assert wrong == []


def parts_imported(name: str) -> set[str]:
    """Return the modules of ours that `name` imports: at the top, in functions, and for type checkers alone."""
    found = set[str]()
    for node in imports_in(name):
        if isinstance(node, ast.ImportFrom):
            base = resolve(name, SOURCES[name].name == "__init__.py", node)
            found |= {inner if (inner := f"{base}.{alias.name}") in SOURCES else base for alias in node.names}
        else:
            found |= {alias.name.removeprefix("thenar.") for alias in node.names}
    return (found & SOURCES.keys()) - {name}


def folder_of(name: str) -> str:
    return name if SOURCES[name].name == "__init__.py" else name.rpartition(".")[0]


def circle(graph: dict[str, set[str]]) -> list[str]:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as found:
        return list(found.args[1])
    return []


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert not circle({name: parts_imported(name) for name in SOURCES})


def test_no_folders_of_a_room_import_each_other_in_a_circle() -> None:
    graph: dict[str, set[str]] = {}
    for name in SOURCES:
        here = folder_of(name)
        for there in map(folder_of, parts_imported(name)):
            if not (fits(there, (here,)) or fits(here, (there,))):
                graph.setdefault(here, set()).add(there)
    assert not circle(graph)


def test_the_reference_is_written_from_the_formulas_and_nothing_else() -> None:
    reference = [name for name in SOURCES if fits(name, ("stability.reference",))]
    named = {
        imported for name in reference for imported in imports(name, imports_in(name)) if imported not in reference
    }
    assert {imported.split(".")[0] for imported in named} <= {"mpmath", *sys.stdlib_module_names}
    assert len(reference) > 5


def test_the_sources_are_found_at_all() -> None:
    assert len(SOURCES) > 40
