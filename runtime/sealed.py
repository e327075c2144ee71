"""The envelope of every binary file that thenar writes: its kind, its format, its length, its checksum.

    offset  bytes  meaning
    0       8      kind, ASCII, e.g. b"THNRGRSP"
    8       2      format version of the payload, little-endian
    10      6      zero
    16      8      length of the payload in bytes, little-endian
    24      32     SHA-256 of bytes 0..23 followed by the payload
    56      ...    payload

The payload is not read before kind, version, length and checksum have been checked.
"""

import struct

from .errors import FormatError

HEADER = struct.Struct("<8sH6xQ32s")
_UNSIGNED = struct.Struct("<8sH6xQ")


def sha256(data: bytes) -> bytes:
    """Return the SHA-256 of `data`."""
    import hashlib  # loads OpenSSL, which takes half as long as msgspec

    return hashlib.sha256(data).digest()


def seal(kind: bytes, version: int, payload: bytes) -> bytes:
    """Return `payload` in its envelope. `kind` is 8 bytes long."""
    start = _UNSIGNED.pack(kind, version, len(payload))
    return start + sha256(start + payload) + payload


def unseal(data: bytes, kind: bytes, newest: int, what: str) -> tuple[int, bytes]:
    """Return (format version, payload) of a sealed file.

    `newest` is the highest format version that the caller reads, `what` the file's name in messages, e.g. "set.grasps".
    Raises FormatError saying which of kind, version, length or checksum is wrong.
    """
    if data[:8] != kind[: len(data)] or not data:
        raise FormatError(f"{what} is not a thenar {kind.decode()} file: it starts with {data[:8]!r}")
    if len(data) < HEADER.size:
        raise FormatError(f"{what} is truncated: {len(data)} bytes, the header alone has {HEADER.size}")
    _, version, length, digest = HEADER.unpack_from(data)
    if version > newest:
        raise FormatError(f"{what} has format {version}, this thenar reads up to {newest}: update thenar")
    if len(data) - HEADER.size < length:
        raise FormatError(f"{what} is truncated: {len(data) - HEADER.size} of {length} payload bytes")
    if len(data) - HEADER.size > length:
        raise FormatError(f"{what} is altered: {len(data) - HEADER.size - length} bytes too many")
    if sha256(data[: _UNSIGNED.size] + data[HEADER.size :]) != digest:
        raise FormatError(f"{what} is altered: its checksum does not match; copy it again from its source")
    return version, data[HEADER.size :]
