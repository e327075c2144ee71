"""Mutants of files: taken apart, changed, and put together again with lengths, seals and checksums that are right.

Every function takes the bytes of a file and a source of randomness and returns the bytes of another. What cannot be
taken apart is changed byte by byte, so that a mutant can be mutated again.
"""

import gzip
import json
import tomllib
import zlib
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from io import BytesIO
from itertools import islice
from random import Random
from struct import Struct
from typing import Any, NamedTuple
from zipfile import ZIP_BZIP2, ZIP_DEFLATED, ZIP_LZMA, ZIP_STORED, ZipFile, ZipInfo

import tomli_w

from thenar.runtime.sealed import HEADER, seal

Mutate = Callable[[bytes, Random], bytes]

# More than this is not taken apart.
_LARGEST = 1 << 20

# Numbers at the edges of the types that hold them.
INTEGERS = (0, 1, -1, 2, 7, 255, 256, 65535, 65536, 2**31, 2**53 + 1, 2**63 - 1, 2**63, 2**64, -(2**63) - 1, 10**30)
FLOATS = (0.0, -0.0, -1.5, 1e-320, 1e-12, 1e17, 1.7e308, -1.7e308, float("inf"), float("-inf"), float("nan"))
TEXTS = (
    "",
    " ",
    "?",
    "0",
    "nan",
    "a\0b",
    "\x1b]0;owned\x07\x1b[2J",
    "two\nlines\r\n",
    "\u202eright to left\u2066",
    "\ud800",
    "\U000e0041\ufeff",
    "=cmd|'/C calc'!A0",
    "*/ int x; /*",
    "../../etc/passwd",
    "/dev/zero",
    "{}%s{0}",
    "a" * 70_000,
    "ß\u0301" * 500,
    "9" * 5_000,
)
# What no value of Python's can spell: it stands in the text in place of a mark.
SPELLINGS = (
    "[" * 20_000 + "]" * 20_000,
    "[" * 3_000,
    '{"a":' * 5_000 + "1" + "}" * 5_000,
    "{a = " * 2_000 + "1" + "}" * 2_000,
    "9" * 10_000,
    "-" + "9" * 400,
    "0x" + "f" * 5_000,
    "1e999999",
    "1." + "0" * 5_000 + "1",
    "0.1e-99999999999",
    "1979-05-27T07:32:00Z",
    '"""',
    '"\\ud800"',
    "null",
    "",
)


_QUOTES = ('"', "'", "\\" * 3000, "'" + "\\'" * 3000, '"' + '""' * 20_000, "{" * 2000)
_NUMERALS = ("9" * 5_000, "1e400", "-0", "0x1F", "1_0", "٣", "nan", "1" + "0" * 400)


def altered(data: bytes, random: Random) -> bytes:
    """Change a few bytes, anywhere."""
    changed = bytearray(data)
    if data and random.random() < 0.4:
        return _overwritten(changed, random)
    for _ in range(random.choice((1, 1, 1, 2, 4, 16))):
        at = random.randrange(len(changed) + 1)
        end = at + random.choice((1, 1, 2, 4, 8, 50))
        match random.randrange(7):
            case 0 if at < len(changed):
                changed[at] ^= 1 << random.randrange(8)
            case 1:
                changed[at:end] = random.randbytes(end - at)
            case 2:
                changed[at:end] = (random.choice(INTEGERS) % (1 << 8 * (end - at))).to_bytes(end - at, "little")
            case 3:
                del changed[at:end]
            case 4:
                changed[at:at] = changed[at:end] * random.choice((1, 1, 2, 300))
            case 5:
                changed[at:at] = random.choice((b"\0", b"\xff", b"\n", b'"', b"\\", b"[", b"\xed\xa0\x80")) * (end - at)
            case _:
                del changed[at + random.randrange(1000) :]
    return bytes(changed)


def _overwritten(changed: bytearray, random: Random) -> bytes:
    """Change bytes or words in their places, so that all lengths stay right."""
    for _ in range(random.choice((1, 1, 2, 8))):
        size = random.choice((1, 1, 2, 2, 4, 8))
        at = random.randrange(len(changed)) // size * size
        if at + size <= len(changed):
            number = int.from_bytes(changed[at : at + size], "little")
            number = random.choice(
                (number + 1, number - 1, 2 * number, number ^ 1 << random.randrange(8 * size), *INTEGERS)
            )
            changed[at : at + size] = (number % (1 << 8 * size)).to_bytes(size, "little")
    return bytes(changed)


def _likely(value: Any, alike: Sequence[Any], random: Random) -> Any:
    """Return another value of the kind of `value`, such as might well be there."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        near = (value + 1, value - 1, 2 * value, value // 2, -value, 0, 1)
        return type(value)(random.choice((*near, *(other for other in alike if abs(other) < 1e18))))
    if isinstance(value, list):
        changed = list(value)
        random.shuffle(changed)
        return random.choice((changed, value[1:], value[:-1], [*value, *value[:1]], []))
    if isinstance(value, str):
        return random.choice((*alike, value + "x", value[1:], value.upper(), f"{value} {value}"))
    return value


def _hostile(kind: type, random: Random) -> Any:
    """Return a value of that kind, or of another one now and then."""
    if random.random() < 0.25:
        kind = random.choice((int, float, str, bool, list, dict))
    if kind is int:
        return random.choice((*INTEGERS, random.randrange(-300, 300)))
    if kind is float:
        return random.choice((*FLOATS, random.uniform(-400, 400)))
    if kind is str:
        return random.choice(TEXTS)
    if kind is bool:
        return random.random() < 0.5
    if kind is list:
        return random.choice(([], [0], [1.5] * 1000, [[]] * 100, [""], [{}], list(range(20))))
    return {"": 0} if kind is dict else None


class _Spot(NamedTuple):
    """A value in a tree: where it is held, and under which key or number."""

    holder: Any
    key: Any

    @property
    def value(self) -> Any:
        return self.holder[self.key]


def _spots(tree: Any) -> Iterator[_Spot]:
    for key in list(tree if isinstance(tree, dict) else range(len(tree))):
        yield _Spot(tree, key)
        if isinstance(tree[key], dict | list):
            yield from _spots(tree[key])


def changed_tree(tree: Any, random: Random) -> dict[str, str]:
    """Change a tree of dicts and lists in place; return which marks in its text stand for what."""
    marks: dict[str, str] = {}
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        spots = list(islice(_spots(tree), 5_000))
        if not spots:
            break
        _change(spots, random, marks)
    return marks


def _change(spots: list[_Spot], random: Random, marks: dict[str, str]) -> None:
    spot, other = random.choice(spots), random.choice(spots)
    holder, key = spot
    if random.random() < 0.5:
        alike = [one.value for one in spots if type(one.value) is type(spot.value)]
        holder[key] = _likely(spot.value, alike, random)
        return
    match random.randrange(9):
        case 0:
            del holder[key]
        case 1:
            holder[key] = _copied(other.value)
        case 2 if isinstance(holder, list):
            holder[key:key] = [holder[key]] * random.choice((1, 1, 2, 40))
        case 3 if isinstance(holder, list):
            random.shuffle(holder)
        case 2 | 3:
            renamed = other.key if isinstance(other.key, str) and random.random() < 0.5 else random.choice(TEXTS)
            holder[renamed] = holder.pop(key)
        case 4:
            mark = f"@@{len(marks)}@@"
            marks[json.dumps(mark)] = random.choice(SPELLINGS)
            holder[key] = mark
        case 5 if isinstance(holder, dict):
            # Two keys alike, which no dict holds.
            mark = f"@@{len(marks)}@@"
            marks[json.dumps(mark)] = json.dumps(key)
            marks[mark] = str(key)
            holder[mark] = _copied(other.value)
        case _:
            holder[key] = _hostile(type(holder[key]), random)


def _copied(value: Any) -> Any:
    return json.loads(json.dumps(value, default=str))


def _spelled(text: str, marks: dict[str, str]) -> bytes:
    for mark, spelling in marks.items():
        text = text.replace(mark, spelling)
    return text.encode("utf-8", "surrogatepass")


def json_file(data: bytes, random: Random) -> bytes:
    """Change a JSON document: its values mostly, its text now and then."""
    try:
        tree = json.loads(data[:_LARGEST])
        if not isinstance(tree, dict | list) or random.random() < 0.1:
            return altered(data, random)
        marks = changed_tree(tree, random)
        return _spelled(json.dumps(tree), marks)
    except (ValueError, RecursionError, TypeError, KeyError):
        return altered(data, random)


def toml_file(data: bytes, random: Random) -> bytes:
    """Change a TOML document: its values mostly, its text now and then."""
    try:
        tree = tomllib.loads(data[:50_000].decode())
        if random.random() < 0.15:
            return altered(data, random)
        marks = changed_tree(tree, random)
        return _spelled(tomli_w.dumps(tree), marks)
    except (ValueError, RecursionError, TypeError, KeyError, AttributeError):
        return altered(data, random)


def table_file(data: bytes, random: Random) -> bytes:
    """Change a text of lines and of cells between commas: cells, rows, columns, quotes."""
    if len(data) > _LARGEST or random.random() < 0.1:
        return altered(data, random)
    rows = [line.split(",") for line in data.decode("utf-8", "surrogateescape").split("\n")]
    for _ in range(random.choice((1, 1, 2, 3))):
        rows = _changed_rows(rows, random)
    return "\n".join(map(",".join, rows)).encode("utf-8", "surrogatepass" if random.random() < 0.5 else "replace")


def _changed_rows(rows: list[list[str]], random: Random) -> list[list[str]]:
    row = random.choice(rows)
    at = random.randrange(len(row))
    match random.randrange(16):
        case 0:
            return [other for other in rows if other is not row] or [[""]]
        case 1:
            # Each a list of its own, and commas counted: otherwise the next change may make hundreds of megabytes.
            return [[*row] for _ in range(random.choice((1, 3, 30_000 // (len(row) + sum(map(len, row))))))] + rows
        case 2:
            random.shuffle(rows)
        case 3:
            return [[*other, other[at] if at < len(other) else ""] for other in rows]
        case 4:
            row[at] = random.choice(_QUOTES)
        case 5:
            row[at] = random.choice(_NUMERALS)
        case 6:
            text = random.choice(TEXTS)
            row[at:at] = [text] * random.choice((1, 1, 5, 20_000 // (1 + len(text))))
        case 7:
            row[at] = str(random.choice((*INTEGERS, *FLOATS, *TEXTS)))
        case _:
            other = random.choice(rows)
            row[at] = other[at] if at < len(other) else random.choice(other)
    return rows


def zipped(mutate: Mutate) -> Mutate:
    """Return what changes what is inside a gzip file, its wrapping now and then, or adds far more than it is long."""

    def change(data: bytes, random: Random) -> bytes:
        try:
            inside = gzip.GzipFile(fileobj=BytesIO(data)).read(_LARGEST + 1)
        except (OSError, EOFError, zlib.error):
            return altered(data, random)
        if len(inside) > _LARGEST:
            return altered(data, random)
        match random.randrange(12):
            case 0 | 1:
                return altered(data, random)
            case 2:
                return data + _blown_up(inside[-4096:] or b"0") * random.choice((1, 30))
        return gzip.compress(mutate(inside, random), compresslevel=1, mtime=0)

    return change


@cache
def _blown_up(piece: bytes) -> bytes:
    """Return some ten million bytes, gzipped."""
    return gzip.compress(piece * (10_000_000 // len(piece)), mtime=0)


_DTYPES = (
    *("|b1", "<u2", "<i8", "<f8", "<f2", ">f8", "<c16", "|O", "<M8[s]", "<m8", "|V8", "|V0", "|S0", "|S4", "<U0"),
    *("<U3", "<U1114112", "<U400000000", "<U99999999999", "f8,f8", "nonsense", "", "<f16"),
)
_SHAPES = (
    *((), (0,), (1,), (2, 3), (0, 0), (-1,), (400_000_000,), (2**31, 2), (2**63,), (10**30,), (1,) * 40, (True,)),
    *((1.5,), (0, 2**40), (2**20, 0)),
)
_METHODS = (ZIP_STORED, ZIP_STORED, ZIP_DEFLATED, ZIP_BZIP2, ZIP_LZMA)


class Member(NamedTuple):
    """A file in a zip."""

    name: str
    content: bytes
    method: int


def npz_file(data: bytes, random: Random) -> bytes:
    """Change arrays in a zip: their names, headers, bytes and packing, and the zip's own bytes now and then."""
    members = _members(data)
    if not members or random.random() < 0.1:
        return altered(data, random)
    for _ in range(random.choice((1, 1, 2))):
        _change_member(members, random)
    return zip_file(members)


def _members(data: bytes) -> list[Member]:
    """Return what is in a zip; nothing where that is a lot, or cannot be read."""
    try:
        with ZipFile(BytesIO(data)) as file:
            infos = file.infolist()
            if sum(info.file_size for info in infos) > _LARGEST:
                return []
            return [Member(info.filename, file.read(info), info.compress_type) for info in infos]
    except Exception:  # whatever a mutant makes of zipfile
        return []


def _change_member(members: list[Member], random: Random) -> None:
    at = random.randrange(len(members))
    name, content, method = members[at]
    match random.randrange(10):
        case 0:
            members[at] = Member(random.choice((*TEXTS, members[0].name, "x.npy")), content, method)
        case 1:
            members[at] = Member(name, content, random.choice(_METHODS))
        case 2:
            members.insert(at, members[at])
        case 3 if len(members) > 1:
            del members[at]
        case 4:
            members[at] = Member(name, content + bytes(random.choice((1, 1000, 20_000_000))), ZIP_DEFLATED)
        case 5:
            members[at] = Member(name, _json_in_array(content, random), method)
        case _:
            members[at] = Member(name, npy_file(content, random), method)


def zip_file(members: list[Member]) -> bytes:
    """Return a zip that is the same on every day."""
    file = BytesIO()
    with ZipFile(file, "w") as archive:
        for name, content, method in members:
            info = ZipInfo(name.replace("\0", "0").encode("utf-8", "replace").decode()[:60_000])
            info.compress_type = method
            archive.writestr(info, content, compresslevel=1)
    return file.getvalue()


_NPY = Struct("<6sBBH")


def npy_file(data: bytes, random: Random) -> bytes:
    """Change an array: its header mostly, as text and by what it says."""
    if len(data) < _NPY.size or random.random() < 0.1:
        return altered(data, random)
    magic, major, minor, length = _NPY.unpack_from(data)
    header, content = data[: _NPY.size + length], data[_NPY.size + length :]
    if content and random.random() < 0.4:
        return header + _overwritten(bytearray(content), random)
    header = header[_NPY.size :]
    try:
        said = dict(_literal(header.decode("latin-1")))
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
        return altered(data, random)
    match random.randrange(8):
        case 0 | 1:
            said["descr"] = random.choice(_DTYPES)
        case 2 | 3:
            said["shape"] = random.choice(_SHAPES)
        case 4:
            said["descr"], said["shape"] = random.choice(_DTYPES), random.choice(_SHAPES)
        case 5:
            said["fortran_order"] = random.choice((True, False, 1, "x"))
        case 6:
            major, minor = random.choice(((2, 0), (3, 0), (0, 0), (255, 255)))
        case _:
            deep = random.choice(("(" * 60_000, "[" * 200 + "]" * 200, "{'descr'", "-" * 9_000 + "1", "{**{}}"))
            return _NPY.pack(magic, major, minor, len(deep)) + deep.encode() + content
    text = repr(said).encode("latin-1", "replace")
    return _NPY.pack(magic, major, minor, len(text)) + text + content


def _literal(text: str) -> dict[str, object]:
    from ast import literal_eval

    found = literal_eval(text.strip())
    if not isinstance(found, dict):
        raise TypeError("the header of an array is a dict")
    return found


def _json_in_array(data: bytes, random: Random) -> bytes:
    """Change a JSON document that is stored as an array of bytes; any other array as such."""
    at = data.find(b"\n", _NPY.size) + 1
    if data[at : at + 1] != b"{":
        return npy_file(data, random)
    return npy_of_bytes(json_file(data[at:], random))


def npy_of_bytes(content: bytes) -> bytes:
    """Return `content` as an array of bytes."""
    header = repr({"descr": "|u1", "fortran_order": False, "shape": (len(content),)}).encode() + b"\n"
    return _NPY.pack(b"\x93NUMPY", 1, 0, len(header)) + header + content


def sealed(mutate: Mutate) -> Mutate:
    """Return what changes the payload of a sealed file, and seals it again; the envelope itself now and then."""

    def change(data: bytes, random: Random) -> bytes:
        if len(data) < HEADER.size or random.random() < 0.05:
            return altered(data, random)
        kind, version, _, _ = HEADER.unpack_from(data)
        return seal(kind, version, mutate(data[HEADER.size :], random))

    return change
