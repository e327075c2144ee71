"""The commands of README.md and of the tutorials run in order, and print what the pages show.

A page's blocks:

    ```sh                        runs, line by line, in one scratch folder for the whole page
    ```text                      directly after it: what it prints, standard output and standard error
    ```c title="main.c"          a file that the reader writes, in any language

In shown output a line `...` stands for any lines that were left out, and `...` in a line for any text. Numbers before a
unit of time (s, ms, µs) depend on the machine and are not compared. `pytest --update-golden` writes what is printed
today into the pages; read the difference before you commit it.
"""

import difflib
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.request import urlopen

import pytest

from .conftest import tool

ROOT = Path(__file__).resolve().parents[1]
TUTORIALS = [*sorted((ROOT / "docs" / "tutorials").glob("*.md")), ROOT / "docs" / "how-to" / "wearer.md"]
QUICK = ("README", "first-board")  # pages of `make test`
LIMIT_S = 600

# What a reader of a clone has, apart from thenar itself.
IN_A_CLONE = ("Makefile", "README.md", "docs", "examples")

# The last command of README's story, which shows a page until the table has been played.
LIVE = "thenar emulate set.grasps --glove glove.toml --period-ms 100 -- thenar run build/ --glove {glove} --web"
# Commands that no page's steps run, each with the reason.
NOT_RUN = {
    "make demo": "takes minutes; it consists of commands that have tests",
    "make test": "would run these tests",
    'pip install ".[compiler,web]"': "installs thenar, which tests/test_packaging.py does from the wheel",
    LIVE: "lasts minutes; a test opens its page",
    "thenar run build/ --glove glove.toml --sink ros:/thenar": "needs a glove",
    "thenar simulate crowd --subjects 20 --repetitions 6 -o hands.grasps": "is for the rates below",
    "thenar evaluate hands.grasps --by subject --tables compositions --prune 30 --trainer logit": (
        "is for the rates below, too"
    ),
}
# Commands that take too long for `make test`: there a page runs up to the first of them.
SLOW = {
    "thenar place set.grasps --draw curve.svg",
    "thenar compile set.grasps -o build/ --sensors 11 --glove glove.toml",
}

FENCE = re.compile(r"```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)```\n", re.DOTALL)
TIME = re.compile(r"\b\d+(?:\.\d+)?(?= (?:s|ms|µs)\b)")


@dataclass(frozen=True)
class Step:
    """A block of commands, or a file (`title`), of a page; `shown` are the lines of output, at `span` of the page."""

    text: str
    title: str = ""
    shown: tuple[str, ...] | None = None
    span: tuple[int, int] = (0, 0)


def steps_of(page: str) -> list[Step]:
    steps: list[Step] = []
    end_of_commands = -1
    for found in FENCE.finditer(page):
        language, title, text = found.groups()
        if title:
            steps.append(Step(text, title))
        elif language == "sh":
            steps.append(Step(text))
        elif language == "text" and steps and not page[end_of_commands : found.start()].strip():
            steps[-1] = Step(steps[-1].text, "", tuple(text.splitlines()), found.span(3))
        end_of_commands = found.end() if language == "sh" else -1
    return steps


def agrees(shown: str, printed: str) -> bool:
    pattern = ".*".join(re.escape(TIME.sub("#", part)) for part in shown.split("..."))
    return re.fullmatch(pattern, TIME.sub("#", printed)) is not None


def brought_up_to_date(shown: tuple[str, ...], printed: list[str]) -> list[str]:
    """Return `shown` with each line that was not printed replaced by the printed line that is most like it."""
    lines: list[str] = []
    at, gap = 0, False
    for line in shown:
        if line == "...":
            lines.append(line)
            gap = True
            continue
        where = range(at, len(printed) if gap else min(at + 1, len(printed)))
        same = next((i for i in where if agrees(line, printed[i])), None)
        if same is None and where:
            same = max(where, key=lambda i: difflib.SequenceMatcher(None, line, printed[i]).ratio())
            line = printed[same]
        if same is not None:
            lines.append(line)
            at, gap = same + 1, False
    return lines if gap else lines + printed[at:]


@dataclass(frozen=True)
class Clone:
    """A scratch folder like a clone, with `thenar` on the PATH."""

    folder: Path
    environment: dict[str, str]

    def prints(self, step: Step) -> list[str]:
        """Run a block as a shell does that stops at the first error."""
        commands = "\n".join(line for line in step.text.splitlines() if line not in NOT_RUN)
        done = subprocess.run(
            ["sh", "-e", "-c", commands], cwd=self.folder, env=self.environment, timeout=LIMIT_S, check=False,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        assert done.returncode == 0, f"{commands}\nended with {done.returncode}:\n{done.stdout}"
        return [line.rstrip() for line in done.stdout.splitlines()]


@pytest.fixture
def clone(tmp_path: Path) -> Clone:
    for name in ("cc", "make"):
        tool(name)
    binaries, folder = tmp_path / "bin", tmp_path / "thenar"
    binaries.mkdir()
    folder.mkdir()
    for name in IN_A_CLONE:
        (folder / name).symlink_to(ROOT / name)
    for name, module in (("thenar", "-P -m thenar.cli "), ("python", "")):
        (binaries / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {module}"$@"\n')
        (binaries / name).chmod(0o755)
    # Unbuffered: standard output and standard error come in the order in which a terminal shows them.
    changed = {"PATH": f"{binaries}:{os.environ['PATH']}", "PYTHONUNBUFFERED": "1", "LC_ALL": "C.UTF-8"}
    return Clone(folder, {**os.environ, **changed})


def is_slow(step: Step) -> bool:
    return not step.title and any(line in SLOW for line in step.text.splitlines())


def check(path: Path, steps: list[Step], clone: Clone, update: bool) -> None:
    """Run the steps of a page and compare; all of its differences are reported, or written into it, at once."""
    page = path.read_text(encoding="utf-8")
    today, moved = page, 0
    for step in steps:
        if step.title:
            (clone.folder / step.title).write_text(step.text, encoding="utf-8")
            continue
        printed = clone.prints(step)
        if step.shown is not None:
            text = "".join(f"{line}\n" for line in brought_up_to_date(step.shown, printed))
            start, end = step.span
            today = today[: start + moved] + text + today[end + moved :]
            moved += len(text) - (end - start)
    if update and today != page:
        path.write_text(today, encoding="utf-8")
    names = f"{path.name} as it is", "as its commands print today"
    difference = difflib.unified_diff(page.splitlines(), today.splitlines(), *names, lineterm="")
    assert update or today == page, "\n".join(("--update-golden would change the page:", *difference))


@pytest.mark.flaky(reruns=2)  # glove-to-robot.md plays an emulated glove in real time
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stem not in QUICK))
        for path in (ROOT / "README.md", *TUTORIALS)
    ],
)
def test_commands_print_what_the_page_shows(path: Path, clone: Clone, update_golden: bool) -> None:
    steps = steps_of(path.read_text(encoding="utf-8"))
    stop = next((i for i, step in enumerate(steps) if is_slow(step)), len(steps))
    check(path, steps[:stop], clone, update_golden)


@pytest.mark.slow
def test_all_commands_of_the_readme_print_what_it_shows_and_end_in_a_live_page(
    clone: Clone, update_golden: bool
) -> None:
    path = ROOT / "README.md"
    check(path, steps_of(path.read_text(encoding="utf-8")), clone, update_golden)
    with subprocess.Popen(
        ["sh", "-c", f"exec {LIVE} 127.0.0.1:0"], cwd=clone.folder, env=clone.environment,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    ) as live:  # fmt: skip
        assert live.stderr is not None
        try:
            (address,) = re.findall(r"the page is at (\S+)", next(line for line in live.stderr if "page" in line))
            with urlopen(address, timeout=LIMIT_S) as page:
                assert b"thenar" in page.read()
        finally:
            live.terminate()


def every_line() -> Iterator[str]:
    for path in (ROOT / "README.md", *TUTORIALS):
        for step in steps_of(path.read_text(encoding="utf-8")):
            yield from step.text.splitlines()


def test_slow_commands_stand_in_the_readme_and_exceptions_on_pages() -> None:
    assert not any(is_slow(step) for path in TUTORIALS for step in steps_of(path.read_text(encoding="utf-8")))
    assert {*NOT_RUN, *SLOW} <= {*every_line()}


def test_a_page_has_no_commands_outside_of_its_blocks() -> None:
    for path in (ROOT / "README.md", *TUTORIALS):
        rest = FENCE.sub("", path.read_text(encoding="utf-8"))
        assert not re.findall(r"^ {4,}(?:thenar|make|python|pip) .*$", rest, re.MULTILINE), path.name
        assert "```" not in rest, f"{path.name}: a block without a language"


PRINTED = ["simulated 3 grasps in 1.3 s", "warning: one", "accuracy 95.1 %", "holds"]


@pytest.mark.parametrize(
    ("shown", "today"),
    [
        (["simulated 3 grasps in 0.9 s", "...", "holds"], None),
        (["simulated ... in 0.9 s", "...", "accuracy 95.1 %", "..."], None),
        (["...", "accuracy 95.2 %", "holds"], ["...", "accuracy 95.1 %", "holds"]),
        (["...", "accuracy 95.1 %"], ["...", "accuracy 95.1 %", "holds"]),
        (["simulated 4 grasps in 1.3 s", "..."], ["simulated 3 grasps in 1.3 s", "..."]),
        (["...", "holds", "and more"], ["...", "holds"]),
    ],
)
def test_shown_output_is_brought_up_to_date(shown: list[str], today: list[str] | None) -> None:
    assert brought_up_to_date(tuple(shown), PRINTED) == (today or shown)


def test_output_belongs_to_the_commands_directly_before_it() -> None:
    output = "```text\nbuild\n```\n"
    page = f'{output}```sh\nls\n```\n\n{output}words\n{output}```c title="a.c"\nint a;\n```\n'
    assert [(step.text, step.title, step.shown) for step in steps_of(page)] == [
        ("ls\n", "", ("build",)),
        ("int a;\n", "a.c", None),
    ]
