"""A mkdocs hook that adds pages: all commands, with the choices of a recipe; effects of scenes; Python; file layouts.

The table of Python's names is in docs/reference/python/index.md itself, where a test compares it with `api_tables()`.
"""

import inspect
import re
from collections.abc import Iterator
from sys import modules
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import click
import msgspec
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from thenar import compiler, runtime
from thenar.cli.choices import choices
from thenar.cli.group import COMMANDS, thenar
from thenar.compiler.artifact import ensemble
from thenar.compiler.recordings import graspset
from thenar.runtime import sealed
from thenar.runtime.model import integers
from thenar.simulator.pipeline.effect import EFFECTS, Effect

COMMANDS_PAGE = "reference/all-commands.md"
EFFECTS_PAGE = "reference/effects.md"
PYTHON_PAGE = "reference/python/signatures.md"
LAYOUTS_PAGE = "reference/layouts.md"
# The modules whose docstrings describe binary files.
LAYOUTS = {"Envelope": sealed, "tables.bin": integers, "ensemble.bin": ensemble, ".grasps": graspset}
BEFORE_COMMANDS = """# All commands and options

This page is made from the commands themselves: `thenar COMMAND --help` prints the same. The rules that all of them
follow are described in [the command line](commands.md).

## The recipe

`compile`, `place` and `evaluate` share these choices, and `thenar.compiler.Recipe` has them as fields. If you change
one, its part and all later parts are computed again: placement and limits, training, tables, rates.

"""


def help_of(name: str) -> str:
    """Return the output of `thenar NAME --help`, 88 columns wide."""
    command = thenar.get_command(click.Context(thenar), name)
    assert command is not None
    context = click.Context(command, info_name=f"thenar {name}", terminal_width=88, max_content_width=88)
    return command.get_help(context)


def recipe_table() -> str:
    """Return the table of all choices of a recipe."""
    lines = ["| option | parameter | part | default | range | what it is |", "|---|---|---|---|---|---|"]
    for choice in choices().values():
        ends = ["" if end is None else f"{end:g}" for end in (choice.least, choice.most)]
        span = ", ".join(map(str, choice.names)) or (" to ".join(ends) if any(ends) else "")
        default = choice.usual or ("" if choice.default in (None, (), {}) else choice.default)
        # Settings of a trainer have an option each.
        option = "" if choice.kind is dict else f"`--{choice.option.replace('_', '-')}`"
        lines.append(f"| {option} | `{choice.name}` | {choice.part} | {default} | {span} | {choice.help} |")
    return "\n".join(lines)


def limits(annotation: Any) -> str:
    """Return the limits of a parameter's type in words; "" if it has none."""
    if get_origin(annotation) is not Annotated:
        return "; ".join(filter(None, map(limits, get_args(annotation))))
    words = []
    for meta in (extra for extra in annotation.__metadata__ if isinstance(extra, msgspec.Meta)):
        ends = (("from", meta.ge), ("above", meta.gt), ("to", meta.le), ("below", meta.lt))
        words += [f"{word} {end:g}" for word, end in ends if end is not None]
        words += ["at least one"] * (meta.min_length is not None)
    return " ".join(words)


def effect_section(name: str, effect: Effect) -> Iterator[str]:
    """Yield the paragraphs of an effect: what its module and its function say, and a table of its parameters."""
    function = effect.prepare or effect.model or effect.together
    assert function is not None
    yield f"## {name}"
    yield inspect.cleandoc(modules[function.__module__].__doc__ or effect.summary)
    for part in (inspect.getdoc(function) or "").split("\n\n")[1:]:
        if not part.startswith("Raises"):
            # A line for each parameter becomes an item of a list.
            yield re.sub(r"^(\w+(?:, \w+)*)  +", r"- `\1`: ", part, flags=re.MULTILINE)
    kinds = get_type_hints(effect.parameters(), include_extras=True)
    lines = ["| parameter | default | limits |", "|---|---|---|"]
    for field in msgspec.structs.fields(effect.parameters()):
        default = {msgspec.NODEFAULT: "required", None: "drawn"}.get(field.default, field.default)
        lines.append(f"| `{field.name}` | {default} | {limits(kinds[field.name])} |")
    if len(lines) > 2:
        yield "\n".join(lines)


def effects() -> str:
    """Return the page of all effects."""
    parts = ["# Effects", "This page is made from the effects themselves. [Scene files](scenes.md) use them."]
    for name, effect in EFFECTS.items():
        parts += effect_section(name, effect)
    return "\n\n".join(parts) + "\n"


def api_names() -> dict[str, Any]:
    """Return the public names of `thenar.compiler`, and the further ones of `thenar.runtime`, with their values."""
    found = {f"thenar.compiler.{name}": getattr(compiler, name) for name in compiler.__all__}
    others = {f"thenar.runtime.{name}": getattr(runtime, name) for name in runtime.__all__}
    return found | {name: value for name, value in others.items() if value not in found.values()}


def api_tables() -> str:
    """Return the tables of functions, with needed arguments and results, and of classes; the names of all others.

    A class that only is a result has no row, since its function has one.
    """
    names = {name.removeprefix("thenar.compiler."): value for name, value in api_names().items()}
    said = {
        name: " ".join(re.split(r"[.;](?:\s|$)|\n\n", inspect.getdoc(value) or "", maxsplit=1)[0].split())
        for name, value in names.items()
    }
    functions = {name: inspect.signature(value) for name, value in names.items() if inspect.isfunction(value)}
    results = {
        name: str(getattr(one.return_annotation, "__name__", one.return_annotation)) for name, one in functions.items()
    }
    calls = []
    for name, signature in functions.items():
        arguments = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
        needed = [one.name for one in arguments if one.default is one.empty]
        shown = ", ".join(needed + ["..."] * (len(needed) < len(arguments)))
        result = f" `{results[name]}`" if results[name] in names else ""
        calls.append(f"| `{name}({shown})` |{result} | {said[name]} |")
    kinds = {name for name, value in names.items() if inspect.isclass(value) and not issubclass(value, Exception)}
    taken = {str(one.annotation) for signature in functions.values() for one in signature.parameters.values()}
    only_results = {name for name in results.values() if not any(name in annotation for annotation in taken)}
    terms = {name for name in kinds if issubclass(names[name], compiler.Term)} - {"Term"}
    classes = [f"| `{name}` | {said[name]} |" for name in names if name in kinds - only_results - terms]
    classes.append(f"| {', '.join(f'`{name}`' for name in sorted(terms))} | The kinds of `Term` that boards read |")
    others = [f"`{name}`" for name in names if name not in {*functions, *kinds}]
    parts = (
        *("| function | result | what it does |", "|---|---|---|", *calls, ""),
        *("| class | what it is |", "|---|---|", *classes, ""),
        "Registries of members by name, and errors, which derive from `ThenarError` and the nearest builtin:",
        ", ".join(others) + ".",
    )
    return "\n".join(parts) + "\n"


def layouts() -> str:
    """Return the page of the layouts of binary files."""
    sections = (f"## {name}\n\n```text\n{module.__doc__}```\n" for name, module in LAYOUTS.items())
    return "# Layouts of binary files\n\n" + "\n".join(sections)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages; called by mkdocs."""
    sections = [f"\n## {name}\n\n```text\n{help_of(name)}\n```\n" for name in COMMANDS]
    commands = BEFORE_COMMANDS + recipe_table() + "\n" + "".join(sections)
    files.append(File.generated(config, COMMANDS_PAGE, content=commands))
    files.append(File.generated(config, EFFECTS_PAGE, content=effects()))
    signatures = "".join(f"\n::: {name}\n" for name, value in api_names().items() if callable(value))
    files.append(File.generated(config, PYTHON_PAGE, content=f"# All signatures\n{signatures}"))
    files.append(File.generated(config, LAYOUTS_PAGE, content=layouts()))
    return files
