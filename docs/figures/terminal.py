"""Draws terminal.svg, the terminal of the README: `python docs/figures/terminal.py` runs the commands and keeps lines.

The letters are the reader's own monospaced font: the drawing loads nothing. It fits light and dark pages.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from adapt import adapted
from rich.console import Console
from rich.terminal_theme import TerminalTheme

from thenar.compiler.pictures import on_paper

WIDTH = 104
# Each command, and what the lines begin with that are shown of what it prints.
SHOWN = (
    ("thenar simulate quick -o set.grasps", ()),
    ("thenar compile set.grasps -o build/ --prune 13", ("build:", "accuracy, pooled")),
    ("thenar verify build/ set.grasps", ("rows that change class", "holds")),
    ("thenar run build/ --replay set.grasps --frames 3", ("{",)),
)


def theme() -> TerminalTheme:
    """Return a theme of the palette's light colours; the only other one in use is blue, for the prompt."""
    paper, ink, link = (tuple(bytes.fromhex(on_paper(name).removeprefix("#"))) for name in ("pale", "ink", "link"))
    return TerminalTheme(paper, ink, [link] * 8)


def main() -> None:
    """Run the commands in a scratch folder and write the drawing next to this file."""
    console = Console(record=True, width=WIDTH, file=sys.stderr, force_terminal=True)
    with tempfile.TemporaryDirectory() as folder:
        for command, starts in SHOWN:
            console.print(f"[bold blue]$[/] {command}", highlight=False)
            words = [sys.executable, "-m", "thenar.cli", *command.split()[1:]]
            done = subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True)
            lines = [line for line in done.stdout.splitlines() if line.startswith(starts or "\0")]
            console.print("\n".join(lines), highlight=False, markup=False, end="\n" if lines else "")
    drawn = console.export_svg(title="thenar", unique_id="thenar", theme=theme())
    text = re.sub(r"\s*@font-face {.*?\n    }", "", drawn, flags=re.DOTALL)
    # Rich draws the frame for dark pages only.
    text = text.replace("rgba(255,255,255,0.35)", on_paper("line"))
    Path(__file__).with_suffix(".svg").write_text(adapted(text), encoding="utf-8")


if __name__ == "__main__":
    main()
