from typing import Annotated, Literal

import msgspec
import pytest

from thenar.runtime.errors import ThenarError
from thenar.runtime.toml_source import TomlText
from thenar.runtime.toml_struct import convert


class OwnError(ThenarError, ValueError):
    pass


class Thing(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    width_mm: Annotated[float, msgspec.Meta(gt=0.0, le=200.0)]
    mass_g: Annotated[float, msgspec.Meta(ge=1.0)] = 5.0
    sd_mm: float = 0.0
    sd_deg: float = 0.0
    hold_ms: float = 0.0
    rate_hz: float = 1.0
    count: Annotated[int, msgspec.Meta(le=2**63 - 1)] = 1
    tags: tuple[str, ...] = ()
    kind: Literal["last", "all"] = "last"
    kinds: tuple[Literal["last", "all"], ...] = ()
    maybe: tuple[int, ...] | None = None
    few: Annotated[tuple[int, ...], msgspec.Meta(max_length=2)] = ()

    def __post_init__(self) -> None:
        if self.count == 13:
            raise ValueError("`count` is unlucky")


class Inner(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    width_mm: float = 1.0
    side: Literal["left", "right"] | None = None
    count: Literal[18, 22] | None = None
    names: dict[str, str] = {}


class Outer(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    inner: tuple[Inner, ...] = msgspec.field(default=(), name="in")
    one: Inner | None = None


def complaint(text: str) -> str:
    source = TomlText("a.toml", f"[thing]\n{text}\n", OwnError)
    with pytest.raises(OwnError) as caught:
        convert(source, ("thing",), source.tables()["thing"], Thing)
    return str(caught.value)


def test_a_table_becomes_a_struct() -> None:
    source = TomlText("a.toml", 'width_mm = 3\ntags = ["x"]\nkind = "all"', OwnError)
    assert convert(source, (), source.tables(), Thing) == Thing(width_mm=3.0, tags=("x",), kind="all")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.toml, line 1: thing: the key width_mm is missing"),
        ("width_mm = -5", "a.toml, line 2: thing.width_mm: must be above 0, not -5"),
        ("width_mm = 0", "a.toml, line 2: thing.width_mm: must be above 0, not 0"),
        ("width_mm = 1e6", "a.toml, line 2: thing.width_mm: must be at most 200, not 1000000.0"),
        ("width_mm = 1\ncount = 9223372036854775808", "thing.count: must be at most 9223372036854775807, not"),
        ("width_mm = 1\nmass_g = 0.5", "a.toml, line 3: thing.mass_g: must be at least 1, not 0.5"),
        ("width_mm = 'wide'", "a.toml, line 2: thing.width_mm: must be a number, not 'wide'"),
        ("width_mm = true", "a.toml, line 2: thing.width_mm: must be a number, not true"),
        ("width_mm = {}", "a.toml, line 2: thing.width_mm: must be a number, not a table"),
        ("width_mm = 1\ncount = 1.5", "a.toml, line 3: thing.count: must be a whole number, not 1.5"),
        ("width_mm = 1\ntags = 'x'", "a.toml, line 3: thing.tags: must be a list, not 'x'"),
        ("width_mm = 1\ntags = [\n'x',\n3]", "a.toml, line 5: thing.tags[1]: must be text, not 3"),
        ("width_mm = 1\ncount = 13", "a.toml, line 1: thing: `count` is unlucky"),
        ("width_mm = 1\nmaybe = 1", "a.toml, line 3: thing.maybe: must be a list, not 1"),
        ("width_mm = 1\nfew = [1, 2, 3]", "a.toml, line 3: thing.few: must be a list of length <= 2"),
        ("width_mm = 1\nkind = 'al'", "thing.kind: 'al' is not among its values (did you mean 'all'?)"),
        ("width_mm = 1\nkinds = ['all', 'x']", "thing.kinds[1]: 'x' is not among its values (there are: all, last)"),
        (f"width_mm = 1{'0' * 400}", "a.toml, line 2: thing.width_mm: is a number out of range"),
    ],
)
def test_a_wrong_value_is_named_with_line_and_requirement(text: str, message: str) -> None:
    assert message in complaint(text)


@pytest.mark.parametrize(
    ("key", "advice"),
    [
        ("width_cm", "this key is unknown (did you mean 'width_mm"),
        ("width", "this key is unknown (did you mean 'width_mm"),
        ("mass_kg", "this key is unknown (did you mean 'mass_g"),
        ("hold_s", "this key is unknown (did you mean 'hold_ms"),
        ("rate_khz", "this key is unknown (did you mean 'rate_hz"),
        ("sd_rad", "this key is unknown (did you mean 'sd_deg"),
        ("sd_cm", "this key is unknown (did you mean 'sd_mm"),
    ],
)
def test_a_key_in_another_unit_is_told_the_nearest(key: str, advice: str) -> None:
    assert complaint(f"width_mm = 1\n{key} = 1").startswith(f"a.toml, line 3: thing.{key}: {advice}")


@pytest.mark.parametrize("number", ["nan", "-nan", "inf", "-inf"])
def test_a_number_that_is_not_finite_is_found_wherever_it_stands(number: str) -> None:
    source = TomlText("a.toml", f"a = 1\n[[b]]\nc = [1,\n {number}]\n", OwnError)
    with pytest.raises(OwnError, match=r"line 4: b\[0\]\.c\[1\]: must be a finite number"):
        source.tables()


def test_what_is_no_table_is_refused() -> None:
    with pytest.raises(OwnError, match="line 1: thing: must be a table, not 3"):
        convert(TomlText("a.toml", "thing = 3", OwnError), ("thing",), 3, Thing)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[in]]\n[[in]]\nwidht_mm = 1", "line 3: in[1].widht_mm: this key is unknown (did you mean 'width_mm'"),
        ("[[in]]\nwidth_cm = 1", "line 2: in[0].width_cm: this key is unknown (did you mean 'width_mm"),
        ("[one]\nside = 'lefd'", "line 2: one.side: 'lefd' is not among its values (did you mean 'left'"),
        ("[one]\ncount = 31", "line 2: one.count: 31 is not among its values (there are: 18, 22)"),
        ("[one]\nnames = { a = 'x', b = 3 }", "line 2: one.names.b: must be text, not 3"),
        ("[one.names]\na = 'x'\nb = []", "line 3: one.names.b: must be text, not an empty list"),
        ("[one]\n[xyz]", "line 2: xyz: this key is unknown (there are: in, one)"),
    ],
)
def test_a_wrong_key_or_value_of_an_inner_table_is_named_likewise(text: str, message: str) -> None:
    source = TomlText("a.toml", text, OwnError)
    with pytest.raises(OwnError) as caught:
        convert(source, (), source.tables(), Outer)
    assert message in str(caught.value)
