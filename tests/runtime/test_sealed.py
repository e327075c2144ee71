import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.errors import FormatError
from thenar.runtime.sealed import HEADER, seal, unseal

KIND = b"THNRTEST"


@given(payload=st.binary(max_size=200), version=st.integers(0, 65535))
def test_what_was_sealed_comes_out_again(payload: bytes, version: int) -> None:
    assert unseal(seal(KIND, version, payload), KIND, 65535, "file") == (version, payload)


@given(payload=st.binary(max_size=60), data=st.data())
def test_any_flipped_bit_is_noticed(payload: bytes, data: st.DataObject) -> None:
    sealed = bytearray(seal(KIND, 1, payload))
    position = data.draw(st.integers(0, 8 * len(sealed) - 1))
    sealed[position // 8] ^= 1 << position % 8
    with pytest.raises(FormatError):
        unseal(bytes(sealed), KIND, 1, "file")


@given(payload=st.binary(max_size=60), data=st.data())
def test_a_truncated_file_is_refused_with_the_reason(payload: bytes, data: st.DataObject) -> None:
    sealed = seal(KIND, 1, payload)
    cut = data.draw(st.integers(8, len(sealed) - 1))
    with pytest.raises(FormatError, match="file is truncated"):
        unseal(sealed[:cut], KIND, 1, "file")


@given(st.binary(max_size=200))
def test_random_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(FormatError):
        unseal(data, KIND, 1, "file")


def test_bytes_after_the_end_are_refused() -> None:
    with pytest.raises(FormatError, match="3 bytes too many"):
        unseal(seal(KIND, 1, b"abc") + b"xyz", KIND, 1, "file")


def test_a_newer_format_is_refused_by_its_number() -> None:
    with pytest.raises(FormatError, match="format 2, this thenar reads up to 1: update thenar"):
        unseal(seal(KIND, 2, b"abc"), KIND, 1, "file")


def test_another_kind_of_file_is_refused() -> None:
    with pytest.raises(FormatError, match="not a thenar THNRTEST file"):
        unseal(seal(b"THNRGRSP", 1, b"abc"), KIND, 1, "file")


def test_the_header_is_as_documented() -> None:
    sealed = seal(KIND, 258, b"abc")
    assert HEADER.size == 56
    assert sealed[:24] == KIND + b"\x02\x01" + bytes(6) + b"\x03" + bytes(7)
