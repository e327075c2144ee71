"""Two standard ROS 2 messages as their bytes: std_msgs/msg/String and std_msgs/msg/UInt8MultiArray.

CDR, little-endian: the encapsulation header 00 01 00 00, then the fields, each aligned to its size (OMG DDSI-RTPS 2.5,
10.2; the lengths of strings and sequences are uint32, and a string's counts its NUL).
"""

from struct import Struct, error

from .errors import McapError

_ENCAPSULATION = b"\0\1\0\0"
_TEXT = Struct("<4sI")
# No dimensions, data_offset 0, then the length of the data.
_BYTES = Struct("<4sIII")

_RULE = "=" * 80

STRING, BYTES = "std_msgs/msg/String", "std_msgs/msg/UInt8MultiArray"
# As `ros2 bag record` embeds them: the definition, then those that it rests on.
DEFINITIONS = {
    STRING: "string data\n",
    BYTES: (
        "MultiArrayLayout layout\nuint8[] data\n"
        f"{_RULE}\nMSG: std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset\n"
        f"{_RULE}\nMSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n"
    ),
}


def encode_text(text: bytes) -> bytes:
    """Return a std_msgs/msg/String of UTF-8 `text`."""
    return _TEXT.pack(_ENCAPSULATION, len(text) + 1) + text + b"\0"


def encode_bytes(data: bytes) -> bytes:
    """Return a std_msgs/msg/UInt8MultiArray of `data`, without dimensions."""
    return _BYTES.pack(_ENCAPSULATION, 0, 0, len(data)) + data


def decode_text(message: bytes) -> bytes:
    """Return the UTF-8 text of a std_msgs/msg/String. Raises McapError."""
    encapsulation, length = _unpack(_TEXT, message)
    text = message[_TEXT.size :]
    if encapsulation != _ENCAPSULATION or length != len(text) or not text.endswith(b"\0"):
        raise McapError("is no little-endian CDR string")
    return text[:-1]


def decode_bytes(message: bytes) -> bytes:
    """Return the data of a std_msgs/msg/UInt8MultiArray without dimensions. Raises McapError."""
    encapsulation, dimensions, data_offset, length = _unpack(_BYTES, message)
    data = message[_BYTES.size :]
    if encapsulation != _ENCAPSULATION or dimensions or data_offset or length != len(data):
        raise McapError("is no little-endian CDR array of bytes without dimensions")
    return data


def _unpack(layout: Struct, message: bytes) -> tuple[bytes, ...] | tuple[int, ...]:
    try:
        return layout.unpack_from(message)
    except error:
        raise McapError(f"has {len(message)} bytes, too few for what its channel carries") from None
