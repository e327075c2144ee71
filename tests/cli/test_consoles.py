"""Texts, tables and views on a terminal that a few lines emulate."""

import re
from io import StringIO

from hypothesis import given
from hypothesis import strategies as st

from thenar.cli.consoles import Console, Live, Text, bar, cells, wrapped
from thenar.cli.printing import table

words = st.text("abcdefghij指é", min_size=1, max_size=12)


class Screen(StringIO):
    """A terminal that knows what a view writes: lines, the way back to the first of them, and clearing."""

    def __init__(self) -> None:
        super().__init__()
        self.lines, self.row, self.hidden = [""], 0, False

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        for part in re.findall(r"\x1b\[[0-9;?]*[A-Za-z]|\n|[^\x1b\n]+", text):
            if part == "\n":
                self.row += 1
                self.lines += [""] * (self.row == len(self.lines))
            elif part.startswith("\x1b["):
                self._obey(part[2:-1], part[-1])
            else:
                self.lines[self.row] += part
        return len(text)

    def _obey(self, number: str, command: str) -> None:
        if command == "F":
            self.row -= int(number)
            assert self.row >= 0
        elif command == "J":
            self.lines[self.row :] = [""]
        elif number == "?25":
            self.hidden = command == "l"
        else:
            assert command == "m"


@given(st.lists(words, max_size=12), st.integers(2, 30))
def test_wrapped_lines_fit_and_hold_every_word(said: list[str], width: int) -> None:
    lines = [*wrapped(" ".join(said), width)]
    assert all(cells(line) <= width for line in lines)
    assert "".join(" ".join(lines).split()) == "".join(said)
    if all(cells(word) <= width for word in said):
        assert " ".join(lines).split() == said


@given(st.lists(st.lists(words, min_size=3, max_size=3), min_size=1, max_size=5), st.integers(12, 60))
def test_a_table_fits_its_lines_are_equally_wide_and_nothing_is_lost(rows: list[list[str]], width: int) -> None:
    file, made = StringIO(), table(("指", "b", "c"), ("c",), "A title", rows)
    Console(file, width=width).print(made)
    framed = [line for line in file.getvalue().splitlines() if line[0] in "┏┃┡│└"]
    for part in "".join(line + "\n" for line in framed).split("┏")[1:]:
        (wide,) = {cells(line) for line in f"┏{part}".splitlines()}
        assert wide <= width
    further = [cell for line in framed if line[0] == "│" for cell in line.split("│")[2:]]
    assert sorted("".join("".join(further).split())) == sorted("".join(word for row in rows for word in row[1:]))


def test_a_view_is_drawn_in_place_and_gone_at_the_end() -> None:
    screen = Screen()
    screen.write("before\n")
    with Live(Console(screen, width=20)) as live:
        live.update("one", Text("two words of a long line", "bold green"))
        assert (screen.lines, screen.hidden) == (["before", "one", "two words of a long", "line", ""], True)
        live.update(bar(0.5, 4))
        assert screen.lines == ["before", "██░░", ""]
    assert (screen.lines, screen.hidden) == (["before", ""], False)


def test_a_file_gets_no_view_and_no_styles() -> None:
    file = StringIO()
    with Live(Console(file)) as live:
        live.update("one")
    Console(file).print(Text("two", "red"))
    assert file.getvalue() == "two\n"
