import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.nesting import DEEPEST_JSON, LONGEST_NUMBER, check_json


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"[" * (DEEPEST_JSON + 1), "nest deeper than 64"),
        (b'{"a":' * 500_000, "nest deeper than 64"),
        (b"[" + b"9" * (LONGEST_NUMBER + 1) + b"]", "longer than 1000 digits"),
        (b'["\\"' + b"]", ""),
        (b'"' + b"[" * 1000 + b'"', ""),
        (b'"' + b'\\"' * 2_000_000, ""),
        (b"[]" * 1000, ""),
    ],
    ids=range(7),
)
def test_too_deep_or_long_json_is_refused_before_parsing(data: bytes, reason: str) -> None:
    if not reason:
        check_json(data)
        return
    with pytest.raises(ValueError, match=reason):
        check_json(data)


VALUES = st.recursive(st.one_of(st.integers(), st.text('[]{}"\\')), lambda inner: st.lists(inner, max_size=3))


@given(VALUES)
def test_any_shallow_json_passes(value: object) -> None:
    check_json(msgspec.json.encode(value))
