"""Sets recorded as one file per trial, whose paths say what was held: data/{label}/{subject}_{trial}.csv.

A field in braces becomes a text column of that name; a star matches anything. Neither matches a slash, so a pattern is
as deep as it has slashes, whatever links there are. Hidden files are left out.
"""

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import SHOWN, list_names, shortened

from . import LARGEST, ROWS, FileRows, TableError, check_room
from .cells import Column, is_numeric, name_of_number, natural_key, pieces, skipped
from .columns import PLAIN, TextFormat
from .foreign import size_of
from .table import SUFFIXES, Table, is_table, is_text, read_table, read_tables, sniff
from .taxonomy import plain, published_for

# The most files of a set.
FILES = 100_000
# The column that names the file of a row; the second name if the files have a column of the first.
_FILE = ("file", "path")
_FIELD = re.compile(r"\{(?P<name>[^\W\d]\w*)\}|(?P<star>\*)|[{}]")

# Takes how many of how many files were read.
Report = Callable[[int, int], None]


class TrialFile(NamedTuple):
    """A file, its path below the pattern's first folder, and the values of the fields in it."""

    path: Path
    name: str
    fields: dict[str, str]


def is_pattern(path: Path) -> bool:
    """Return whether `path` is a pattern: it has a brace and is no file."""
    return "{" in str(path) and not path.exists()


def find_files(pattern: Path) -> tuple[list[TrialFile], list[str]]:
    """Return the files that match `pattern`, in natural order, and the names of tables next to them that do not.

    Raises TableError if there are none, too many, or files of several kinds; OSError from the operating system.
    """
    parts = pattern.parts
    fixed = next((place for place, part in enumerate(parts) if _FIELD.search(part)), len(parts) - 1)
    root = Path(*parts[:fixed])
    expressions = [_expression(part, pattern) for part in parts[fixed:]]
    found, others = [TrialFile(root, "", {})], list[str]()
    for depth, expression in enumerate(expressions, start=1):
        last = depth == len(expressions)
        level = [_matches(file, expression, last, others) for file in found]
        found = [file for matched in level for file in matched]
        if len(found) > FILES:
            raise TableError(f"{pattern} matches more than {FILES} files, the most that are read of a set")
    if not found:
        there = f": next to them are {list_names(others)}" if others else ""
        raise TableError(f"no table matches {pattern}{there}")
    if bags := [file for file in found if file.path.is_dir()]:
        # A pattern without a suffix matches whatever is next to them.
        others += [file.name for file in found if file not in bags]
        found = bags
    kinds = sorted({_suffix(file.path).lower() for file in found})
    if len(kinds) > 1:
        raise TableError(f"{pattern} matches files of several kinds, {list_names(kinds)}: name one")
    found.sort(key=lambda file: natural_key(file.name))
    seen: dict[tuple[int, int], TrialFile] = {}
    for file in found:
        status = file.path.stat()
        first = seen.setdefault((status.st_dev, status.st_ino), file)
        if first is not file:
            raise TableError(f"{file.name} and {first.name} are one file: its trial would count twice, remove the link")
    return found, sorted(others)


def _suffix(path: Path) -> str:
    """Return the suffix of a file, "" of a folder."""
    return "" if path.is_dir() else path.suffix


def _expression(part: str, pattern: Path) -> re.Pattern[str]:
    """Return the regular expression of one folder or file name of a pattern. Raises TableError."""
    text, start = "", 0
    for field in _FIELD.finditer(part):
        if not (field["name"] or field["star"]):
            raise TableError(f"{pattern}: a field of a pattern is a name in braces, such as {{label}} or {{trial}}")
        # A field takes as little as possible: it ends before the first text that follows it.
        text += re.escape(part[start : field.start()])
        name = field["name"]
        text += ".*?" if name is None else f"(?P={name})" if f"(?P<{name}>" in text else f"(?P<{name}>.+?)"
        start = field.end()
    return re.compile(text + re.escape(part[start:]), re.DOTALL)


def _matches(folder: TrialFile, expression: re.Pattern[str], last: bool, others: list[str]) -> Iterator[TrialFile]:
    """Yield the entries of a folder that match; add to `others` the names of tables that do not."""
    with os.scandir(folder.path) as entries:
        for entry in entries:
            here = is_table(Path(entry.path))
            if entry.name.startswith(".") or not (here if last else entry.is_dir() and not here):
                continue
            match = expression.fullmatch(entry.name)
            fields = match.groupdict() if match else {}
            if match and all(folder.fields.get(name, value) == value for name, value in fields.items()):
                yield TrialFile(Path(entry.path), f"{folder.name}/{entry.name}".lstrip("/"), folder.fields | fields)
            elif last:
                others.append(entry.name)


def read_files(files: Sequence[TrialFile], text: TextFormat, report: Report) -> Table:
    """Return the tables in `files`, of the format `text`, as one: the fields of the paths, then the files' columns.

    The last column is the path of each row's file. Raises TableError naming the file, and OSError.
    """
    if (size := sum(size_of(file.path) for file in files)) > LARGEST:
        raise TableError(f"{len(files)} files have more than {LARGEST} bytes, the most that are read of a set")
    tables: list[Table] = []
    rows = 0
    reading = read_tables([file.path for file in files], text)
    for number, file in enumerate(files, start=1):
        try:
            tables.append(next(reading))
        except TableError as reason:
            # Messages begin with the name of the file: complete its path.
            above = file.name.rpartition("/")[0]
            raise TableError(f"{above}/{reason}" if above else str(reason)) from reason
        rows += len(tables[-1].rows)
        if rows > ROWS:
            raise TableError(f"the files up to {file.name} have more than {ROWS} rows, the most that are read of a set")
        _check_alike(files[0].name, tables[0], file.name, tables[-1])
        report(number, len(files))
    columns: dict[str, Column] = {
        name: _joined([table.columns[name] for table in tables]) for name in tables[0].columns
    }
    counts = [len(table.rows) for table in tables]
    fields: dict[str, Column] = {}
    for name in files[0].fields:
        if name in columns:
            raise TableError(f"{files[0].name} has a column {name!r}, as the pattern has: rename that field of it")
        fields[name] = _repeated([file.fields[name] for file in files], counts, size)
    named_by = next(name for name in (*_FILE, "") if name not in {*columns, *fields})
    paths = _repeated([file.name for file in files], counts, size)
    return Table(
        f"{len(files)} files",
        {**fields, **columns, named_by: paths},
        FileRows.of([(file.name, table.rows) for file, table in zip(files, tables, strict=True)], named_by, (*fields,)),
        size=size,
        cells=tables[0].cells,
        decimal=tables[0].decimal,
        skip=tables[0].skip,
        notes=tuple(dict.fromkeys(note for table in tables for note in table.notes)),
    )


def read_path(
    path: Path, text: TextFormat | None, report: Report, more: Sequence[Path] = ()
) -> tuple[Table, TextFormat, list[str]]:
    """Return the table in `path`, or in the files that match it as a pattern, its format, and sentences on that.

    Without `text` the format is found. Files are left out that one of the patterns `more` describes more closely.
    Raises TableError, OSError.
    """
    files, others = find_files(path) if is_pattern(path) else ([], [])
    for other in (other for other in more if files and other != path):
        theirs = {file.path.absolute() for file in find_files(other)[0]} if is_pattern(other) else {other.absolute()}
        others = [name for name in others if name not in {file.name for file in theirs}]
        if theirs < {file.path.absolute() for file in files}:
            files = [file for file in files if file.path.absolute() not in theirs]
    first = files[0].path if files else path
    remarks: list[str] = []
    if text is None:
        text, remarks = sniff(first) if is_text(first) else (PLAIN._replace(skip=None), [])
    table = replace(read_files(files, text, report), what=str(path)) if files else read_table(path, text)
    if text.skip is None:
        text, remarks = PLAIN._replace(skip=table.skip), [skipped(table.skip)] * bool(table.skip)
        if any(_has_comma_numbers(column) for column in table.columns.values()):
            text, table = text._replace(decimal=","), replace(table, decimal=",")
            remarks.append("decimal sign: a comma")
    if others:
        left = f"{len(others)} tables next to them do not match: {list_names([shortened(name) for name in others])}"
        remarks = [f"files: {len(files)}; {left}", *remarks]
    return table, text, remarks


def _has_comma_numbers(column: Column) -> bool:
    """Return whether a column is text that holds nothing but numbers, of which some have a decimal comma."""
    cells = [] if is_numeric(column) else [cell for piece in pieces(column) for cell in piece if cell]
    return any("," in cell for cell in cells) and all(re.fullmatch(r"[-+]?\d+(,\d+)?", cell) for cell in cells)


def _check_alike(first: str, table: Table, other: str, its: Table) -> None:
    """Raise TableError if two tables have other columns, in whatever order."""
    if table.columns.keys() == its.columns.keys():
        return
    lacks = [shortened(repr(name)) for name in table.columns if name not in its.columns]
    more = [shortened(repr(name)) for name in its.columns if name not in table.columns]
    said = [f"it lacks {list_names(lacks)}"] * bool(lacks) + [f"it has {list_names(more)}"] * bool(more)
    advice = "if a trial has several files, name a pattern for each kind of them"
    raise TableError(f"{other} has other columns than {first}: {' and '.join(said)}; {advice}")


def _joined(parts: Sequence[Column]) -> Column:
    """Return the cells of a column in several files: as they are if all are text or all numbers, else as text."""
    arrays = [np.asarray(part) for part in parts]
    if len({*map(is_numeric, arrays)}) == 1:
        return np.concatenate(arrays)
    texts = [list(map(name_of_number, array.tolist())) if is_numeric(array) else array for array in arrays]
    return np.concatenate([np.asarray(text, np.str_) for text in texts])


def _repeated(values: Sequence[str], counts: Sequence[int], size: int) -> NDArray[np.str_]:
    check_room(sum(counts), max(map(len, values)), size)
    return np.repeat(np.array(values, np.str_), counts)


# A folder without a pattern: which part of the paths says what.

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
    levels.append([*_tokens([path.name.removesuffix(_suffix(path)) for path in found]), _suffix(found[0])])
    inside = read_path(found[0], None, lambda _done, _total: None)[0].columns
    names = _named([part for level in levels for part in level if isinstance(part, _Part)], [*inside])
    pattern = "/".join(
        "".join(f"{{{names[part.texts]}}}" if isinstance(part, _Part) else re.sub(r"[{}]", "*", part) for part in level)
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
        here = {name for name in (*folders, *names) if not name.startswith(".") and is_table(Path(place, name))}
        folders[:] = sorted(name for name in folders if name[0] != "." and name not in here) if depth < _DEPTH else []
        for path in (Path(place, name) for name in sorted(here)):
            total += 1
            shapes.setdefault((depth, _suffix(path).lower()), []).append(path)
        if total > FILES:
            raise TableError(f"{folder} holds more than {FILES} tables, the most that are read of a set")
    tables = max(shapes.values(), key=len, default=[])
    # Notes of another form lie among the data: README.txt.
    forms = Counter(_form(path.name.removesuffix(_suffix(path))) for path in tables)
    form, count = forms.most_common(1)[0] if forms else ("", 0)
    if count >= 0.5 * len(tables):
        tables = [path for path in tables if _form(path.name.removesuffix(_suffix(path))) == form]
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
