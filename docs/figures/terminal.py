"""Draws terminal.svg, the terminal of the README: `python docs/figures/terminal.py` runs the commands and keeps lines.

The letters are the reader's own monospaced font: the drawing loads nothing.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console

WIDTH = 104
# Each command, and what the lines begin with that are shown of what it prints.
SHOWN = (
    ("thenar simulate quick -o set.grasps", ()),
    ("thenar compile set.grasps -o build/ --prune 13", ("build:", "accuracy, new", "accuracy, pooled")),
    ("thenar verify build/ set.grasps", ("rows that change class", "holds")),
    ("thenar run build/ --replay set.grasps --frames 3", ("{",)),
)


def main() -> None:
    """Run the commands in a scratch folder and write the drawing next to this file."""
    console = Console(record=True, width=WIDTH, file=sys.stderr, force_terminal=True)
    with tempfile.TemporaryDirectory() as folder:
        for command, starts in SHOWN:
            console.print(f"[bold green]$[/] {command}", highlight=False)
            words = [sys.executable, "-m", "thenar.cli", *command.split()[1:]]
            done = subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True)
            lines = [line for line in done.stdout.splitlines() if line.startswith(starts or "\0")]
            console.print("\n".join(lines), highlight=False, markup=False, end="\n" if lines else "")
    drawn = console.export_svg(title="thenar", unique_id="thenar")
    text = re.sub(r"\s*@font-face {.*?\n    }", "", drawn, flags=re.DOTALL)
    Path(__file__).with_suffix(".svg").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
