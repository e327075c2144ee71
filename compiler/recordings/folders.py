"""Propose the pattern of a folder in which each trial is one file: which part of the paths says what."""

import os
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from thenar.runtime.names import SHOWN, list_names, shortened

from .columns import PLAIN
from .errors import TableError
from .sniff import sniff
from .table import SUFFIXES, is_text, read_table
from .taxonomy import plain, published_for
from .trial_files import FILES
from .trials import natural_key

_DEPTH = 8
_LETTERS_DIGITS = re.compile(r"([^\W\d_]*)(\d+)")
_TOKEN = re.compile(r"([_\-. ]+)")
# The fields and the words before their numbers, as in s1_t03 or subject_1; singular, in lower case.
_HINTS = {
    "subject": "s su sub subj subject p part participant person proband user wearer",
    "session": "session sess ses day d visit",
    "object": "o obj object item",
    "trial": "t tr trial r rep repetition run take attempt try n no nr",
    "label": "g grasp grip gesture label class c pose",
}
_FIELDS = {word: field for field, words in _HINTS.items() for word in words.split()}
# Labels of many sets of grasps and gestures: the part of a path with one of them is the label.
_LABELS = frozenset(
    ("rest", "open", "close", "fist", "pinch", "power", "hook", "tripod", "lateral", "point", "palmar", "grasp")
)


class _Part(NamedTuple):
    """A part of all paths: its texts (one per file), and the word before its numbers."""

    texts: tuple[str, ...]
    hint: str

    @property
    def is_number(self) -> bool:
        return all(text.isdecimal() for text in self.texts)


def propose_pattern(folder: Path) -> tuple[Path, list[str]]:
    """Return the pattern of the tables in `folder`, and sentences on what was found.

    The tables are those of the most frequent kind and depth. Raises TableError if there are none, OSError.
    """
    found, most = _tables(folder)
    if not found:
        raise TableError(f"{folder} holds no tables ({', '.join(SUFFIXES)}): name another folder, or a file")
    paths = [path.relative_to(folder) for path in found]
    if len(paths) == 1:
        return found[0], [f"{folder} holds one table, {shortened(str(paths[0]))}"]
    levels = [_tokens([path.parts[depth] for path in paths]) for depth in range(len(paths[0].parts) - 1)]
    suffix = paths[0].suffix
    levels.append([*_tokens([path.name.removesuffix(path.suffix) for path in paths]), suffix])
    first = found[0]
    inside = read_table(first, sniff(first)[0] if is_text(first) else PLAIN._replace(skip=None)).columns
    names = _named([part for level in levels for part in level if isinstance(part, _Part)], [*inside])
    pattern = "/".join(
        "".join(f"{{{names[part.texts]}}}" if isinstance(part, _Part) else _plain(part) for part in level)
        for level in levels
    )
    remarks = [f"{len(paths)} files as {folder / pattern}"]
    for texts, name in names.items():
        different = sorted({*texts}, key=natural_key)
        shown = list_names([shortened(text) for text in different[:SHOWN]], len(different))
        remarks.append(f"{name}: {len(different)} different, {shown}")
    remarks += [f"left out: {most} tables of another kind or depth, or with other names"] * bool(most)
    return folder / pattern, remarks


def _tables(folder: Path) -> tuple[list[Path], int]:
    """Return the tables of the most frequent shape of path, in order, and the number of others."""
    shapes: dict[tuple[int, str], list[Path]] = {}
    total = 0
    for place, folders, names in os.walk(folder):
        depth = len(Path(place).relative_to(folder).parts)
        folders[:] = sorted(name for name in folders if not name.startswith(".")) if depth < _DEPTH else []
        for name in sorted(names):
            if name.lower().endswith(SUFFIXES) and not name.startswith("."):
                total += 1
                shapes.setdefault((depth, Path(name).suffix.lower()), []).append(Path(place, name))
        if total > FILES:
            raise TableError(f"{folder} holds more than {FILES} tables, the most that are read of a set")
    tables = max(shapes.values(), key=len, default=[])
    # Notes of another form lie among the data: README.txt.
    forms = Counter(_form(path.stem) for path in tables)
    form, count = forms.most_common(1)[0] if forms else ("", 0)
    if count >= 0.5 * len(tables):
        tables = [path for path in tables if _form(path.stem) == form]
    return tables, total - len(tables)


def _form(stem: str) -> str:
    """Return the separators of a name, and whether digits end the parts between them."""
    return "".join(
        part if number % 2 else "0" * part[-1:].isdecimal() for number, part in enumerate(_TOKEN.split(stem))
    )


def _tokens(names: Sequence[str]) -> list[_Part | str]:
    """Return the parts of `names`: those that differ, and the texts between them that do not."""
    split = [_TOKEN.split(name) for name in names]
    if len({(len(parts), *parts[1::2]) for parts in split}) > 1:
        return [_Part(tuple(names), "")]
    tokens: list[_Part | str] = []
    word = ""
    for texts in zip(*split, strict=True):
        numbered = [_LETTERS_DIGITS.fullmatch(text) for text in texts]
        prefixes = {match[1] for match in numbered if match}
        if len({*texts}) == 1:
            tokens.append(texts[0])
            word = texts[0] if texts[0].isalpha() else word
        elif all(numbered) and len(prefixes) == 1:
            (prefix,) = prefixes
            tokens += [prefix] * bool(prefix)
            tokens.append(_Part(tuple(match[2] for match in numbered if match), (prefix or word).casefold()))
            word = ""
        else:
            tokens.append(_Part(texts, word.casefold()))
            word = ""
    return tokens


def _named(parts: Sequence[_Part], columns: Sequence[str]) -> dict[tuple[str, ...], str]:
    """Return the names of the parts that differ, by their texts; equal parts have one name.

    columns  names of the columns of a file: what these say, no part says
    """
    rest = list({part.texts: part for part in reversed(parts)}.values())[::-1]
    words = {word for column in columns for word in re.findall(r"[^\W\d_]{3,}", column.casefold())}
    inside = {_FIELDS.get(word.removesuffix("s")) for word in words}
    names: dict[tuple[str, ...], str] = {}

    def name(part: _Part, *fields: str) -> None:
        free = [field for field in fields if field not in {*names.values(), *columns}]
        names[part.texts] = free[0] if free else f"part{parts.index(part) + 1}"
        rest.remove(part)

    for part in rest[:]:
        if (field := _FIELDS.get(part.hint.removesuffix("s") or part.hint)) and field not in names.values():
            name(part, field)
    texts = [part for part in rest if not part.is_number]
    if texts and "label" not in inside and "label" not in names.values():
        name(max(texts, key=_is_label), "label")
    if (numbers := [part for part in rest if part.is_number]) and "trial" not in names.values():
        name(numbers[-1], "trial")
    for part in rest[:]:
        name(part, *(field for field in ("subject", "session", "object") if field not in inside))
    return names


def _is_label(part: _Part) -> bool:
    """Return whether the texts of a part are known as names of grasps."""
    texts = {*part.texts}
    return published_for(texts) is not None or any(plain(text) in _LABELS for text in texts)


def _plain(text: str) -> str:
    """Return `text` for a pattern, in which braces are no letters."""
    return re.sub(r"[{}]", "*", text)
