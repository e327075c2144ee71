"""Every key's line, whatever the spelling: checked against what tomllib itself reads."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from time import process_time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.errors import ThenarError
from thenar.runtime.toml_source import Place, TomlText, read_source, spelled
from thenar.simulator.scenes import shipped


class OwnError(ThenarError, ValueError):
    pass


AWKWARD = '''\
# [not.a.table]
name = "a # b = [" # comment [x]
long = """
[not.a.table]
a = 3 ""quoted"" """""
literal = \'\'\'
[nor.this]\'\'\'
[effects.joint.noise]
sd_deg = 1.5
after = ["a",

  "b",  # ]
]
[[subjects]]
name = "A"
[[subjects]]
"na me" = 1979-05-27 07:32:00
[subjects.sub]
x.'y.z'."w" = {a = 1, b = [1, {c = 2.0}], d = {}}
[[subjects.deep]]
k=-inf
[[subjects.deep]]
k = +1.5e-3
'''


def places(value: object, here: Place = ()) -> Iterator[Place]:
    yield here
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in inside:
        yield from places(item, (*here, key))


@pytest.mark.parametrize(
    ("place", "line"),
    [
        ((), 1),
        (("name",), 2),
        (("long",), 3),
        (("literal",), 6),
        (("effects", "joint"), 8),
        (("effects", "joint", "noise", "sd_deg"), 9),
        (("effects", "joint", "noise", "after", 1), 12),
        (("subjects", 0), 14),
        (("subjects", 1), 16),
        (("subjects", 1, "na me"), 17),
        (("subjects", 1, "sub", "x", "y.z", "w", "b", 1, "c"), 19),
        (("subjects", 1, "deep", 0, "k"), 21),
        (("subjects", 1, "deep", 1, "k"), 23),
    ],
    ids=str,
)
def test_a_key_has_the_line_on_which_it_stands(place: Place, line: int) -> None:
    assert TomlText("a.toml", AWKWARD, OwnError).line(place) == line
    assert TomlText("a.toml", AWKWARD.replace("\n", "\r\n"), OwnError).line(place) == line


@pytest.mark.parametrize("text", [AWKWARD, *(file.read_text() for file in shipped().values())])
def test_every_toml_entry_has_its_own_line(text: str) -> None:
    source = TomlText("a.toml", text, OwnError)
    for place in places(tomllib.loads(text)):
        if place and isinstance(place[-1], str):
            assert place[-1] in text.splitlines()[source.line(place) - 1]


def test_a_missing_key_has_its_tables_line() -> None:
    source = TomlText("a.toml", AWKWARD, OwnError)
    assert source.line(("subjects", 1, "hand_length_mm")) == 16
    assert source.line(("nothing", 3, "at all")) == 1


def _depth(value: object) -> int:
    inside = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return 0 if inside is None else 1 + max(map(_depth, inside), default=0)


keys = st.text(min_size=1, max_size=8).filter(lambda key: key.isprintable())


@given(names=st.lists(keys, min_size=1, max_size=5, unique=True), blanks=st.integers(0, 3))
def test_quoted_keys_of_any_letters_are_found(names: list[str], blanks: int) -> None:
    quoted = ['"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"' for name in names]
    text = "".join(f"{name} = {{{name} = 1}}\n" + "\n" * blanks for name in quoted)
    source = TomlText("a.toml", text, OwnError)
    assert set(source.tables()) == set(names)
    for number, name in enumerate(names):
        assert source.line((name, name)) == 1 + number * (1 + blanks)


def test_an_error_names_file_line_and_keys() -> None:
    error = TomlText("a.toml", AWKWARD, OwnError).error(("subjects", 1, "na me"), "is no name")
    assert str(error) == "a.toml, line 17: subjects[1].na me: is no name"
    assert spelled(("effects", "joint", "noise", "after", 0)) == "effects.joint.noise.after[0]"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a = 1\nb = \n", "line 2"),
        ("a = 1\na = 2\n", "line 2"),
        ("a = [", "end of document"),
        ("a = " + "9" * 5000, "digits"),
        ("a = 0x" + "f" * 5000, "digits"),
        ("a = " + "[" * 11 + "]" * 11, "nest deeper than 10 levels"),
        ("a = " + "[" * 400_000, "nest deeper than 10 levels"),
        ("a" + ".a" * 400_000 + " = 1", "nest deeper than 10 levels"),
        ("a = '''\n'''" + "[" * 2000, "nest deeper than 10 levels"),
        ("a = {b = " * 2000, "nest deeper than 10 levels"),
        ("a = 1\n" * 200_000, "is longer than 1000000 characters"),
        ("a = " + '"' * 900_000, "is not valid TOML"),
    ],
    ids=range(12),
)
def test_what_is_no_toml_is_refused_with_the_reason(text: str, reason: str) -> None:
    with pytest.raises(OwnError, match=reason) as caught:
        TomlText("a.toml", text, OwnError).tables()
    assert str(caught.value).startswith("a.toml is ")
    assert len(str(caught.value)) < 500


@given(st.text("[]{}=,.\n\"'# \\a1", max_size=60))
def test_only_the_brackets_that_tomllib_reads_count_as_levels(text: str) -> None:
    source = TomlText("a.toml", f"a = [{text}", OwnError)
    try:
        deep = _depth(tomllib.loads(source.text))
    except ValueError:
        return
    if deep <= 10:
        source.tables()


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1\n")
    assert read_source(path, OwnError) == TomlText("a.toml", "a = 1\n", OwnError)


def test_text_that_is_not_utf8_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes("a = 1\nname = 'Stra\u00dfe'\n".encode("latin-1"))
    with pytest.raises(OwnError, match=r"a\.toml, line 2: the text is not UTF-8"):
        read_source(path, OwnError)


def test_a_file_beyond_the_limit_and_an_endless_device_are_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"#" * 1_000_001)
    with pytest.raises(OwnError, match="larger than 1000000 bytes"):
        read_source(path, OwnError)
    endless = tmp_path / "endless.toml"
    endless.symlink_to("/dev/zero")
    with pytest.raises(OwnError, match="is a device or a pipe"):
        read_source(endless, OwnError)


def test_what_an_error_repeats_of_a_file_is_short_and_printable() -> None:
    key, value = "k" * 100_000, "v" * 100_000
    source = TomlText("a.toml", f'{key} = "{value}"', OwnError)
    said = str(source.error((key,), f"{value} is no value"))
    assert len(said) < 600
    assert "\x1b" not in str(source.error((), "obeyed \x1b[2J"))


def test_a_folder_is_refused_as_what_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(OwnError, match="cannot be read: Is a directory"):
        read_source(tmp_path, OwnError)


def test_a_table_is_found_by_its_own_header_though_another_one_made_it() -> None:
    text = "[a.b]\nx = 1\n[a]\ny = 2\n"
    assert [TomlText("a.toml", text, ThenarError).line(place) for place in (("a",), ("a", "z"), ("a", "b"))] == [
        3,
        3,
        1,
    ]


def test_a_line_at_the_end_of_a_long_file_costs_little_more_than_reading_it() -> None:
    text = "".join(f'[[bus.chip]]\nkind = "mcp23017"\n[bus.chip.pins]\nGPA0 = "s{number}"\n' for number in range(3000))
    source = TomlText("glove.toml", f"[[bus]]\n{text}", ThenarError)
    began = process_time()
    source.tables()
    read_s, began = process_time() - began, process_time()
    assert source.line(("bus", 0, "chip", 2999, "pins", "GPA1")) == 12_000
    assert process_time() - began < 8 * read_s
