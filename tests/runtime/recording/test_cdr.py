import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from thenar.runtime.errors import FormatError
from thenar.runtime.recording.layout import (
    BYTES,
    DEFINITIONS,
    STRING,
    decode_bytes,
    decode_text,
    encode_bytes,
    encode_text,
)


def ros(name: str, message: bytes) -> object:
    """Return the `data` of a message as another implementation of ROS 2's formats reads it."""
    schema = Schema(1, DEFINITIONS[name].encode(), "ros2msg", name)
    decode = DecoderFactory().decoder_for("cdr", schema)
    assert decode is not None
    return decode(message).data


@given(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])))
def test_a_string_is_what_ros_reads(text: str) -> None:
    message = encode_text(text.encode())
    assert ros(STRING, message) == text
    assert decode_text(message) == text.encode()


@given(st.binary())
def test_bytes_are_what_ros_reads(data: bytes) -> None:
    message = encode_bytes(data)
    assert bytes(ros(BYTES, message)) == data  # type: ignore[call-overload]
    assert decode_bytes(message) == data


@pytest.mark.parametrize("decode", [decode_text, decode_bytes])
@given(st.binary(max_size=30))
def test_other_bytes_are_refused(decode: object, message: bytes) -> None:
    encode = {decode_text: encode_text, decode_bytes: encode_bytes}[decode]  # type: ignore[index]
    try:
        found = decode(message)  # type: ignore[operator]
    except FormatError:
        return
    assert encode(found) == message
