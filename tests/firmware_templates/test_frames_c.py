"""The C decoder and encoder against drivers.scanner_protocol, on streams as bad cables make them."""

import ctypes
from collections.abc import Callable

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from thenar.compiler.firmware.protocol import BoardConfig, protocol_files
from thenar.drivers import scanner_protocol
from thenar.drivers.scanner_protocol import MAX_PAYLOAD, OVERHEAD, Frame

SharedLibrary = Callable[..., ctypes.CDLL]
NOTHING, GOOD, DAMAGED, SHORT, OVERLONG = range(5)


class Decoder(ctypes.Structure):
    """thenar_decoder, with room for bodies of any length."""

    _fields_ = (("body", ctypes.c_uint8 * 512),)


class Frames:
    """thenar_frames.c, which keeps so many bytes of a payload."""

    def __init__(self, shared_library: SharedLibrary, kept: int) -> None:
        files = {name: text for name, text in protocol_files(BoardConfig(1, 8)).items() if "frames" in name}
        self.kept = kept
        self.library = shared_library(files, f"-DTHENAR_FRAME_KEPT={kept}u")
        self.decoder = Decoder()

    def encode(self, frame: Frame) -> bytes:
        buffer = (ctypes.c_uint8 * (MAX_PAYLOAD + OVERHEAD))()
        buffer[3 : 3 + len(frame.payload)] = list(frame.payload)
        length = self.library.thenar_frames_encode(buffer, frame.kind, frame.sequence, len(frame.payload))
        return bytes(buffer[:length])

    def decode(self, stream: bytes) -> tuple[list[Frame], list[int], list[int]]:
        """Return the frames, as far as they are kept, how long their payloads are, and how often each outcome came."""
        decoder = ctypes.byref(self.decoder)
        self.library.thenar_decoder_reset(decoder)
        frames, lengths, outcomes = [], [], [0] * 5
        for byte in stream:
            outcome = self.library.thenar_decoder_take(decoder, byte)
            outcomes[outcome] += 1
            if outcome == GOOD:
                length = self.library.thenar_decoder_payload(decoder)
                body = bytes(self.decoder.body[: 2 + min(length, self.kept)])
                frames.append(Frame(body[0], body[1], body[2:]))
                lengths.append(length)
        return frames, lengths, outcomes


@pytest.fixture(scope="module", params=[12, 250])
def frames(request: pytest.FixtureRequest, shared_library: SharedLibrary) -> Frames:
    return Frames(shared_library, request.param)


BYTE = st.integers(0, 255)
# Zeros and long runs without any are what COBS is about.
PAYLOADS = st.one_of(
    st.binary(max_size=MAX_PAYLOAD),
    st.lists(st.sampled_from([0, 1, 255]), max_size=MAX_PAYLOAD).map(bytes),
    st.integers(0, MAX_PAYLOAD).map(lambda length: b"\1" * length),
)
SOUND = st.builds(Frame, BYTE, BYTE, PAYLOADS)


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A frame of which a cable has changed, left out or added something."""
    wire = bytearray(scanner_protocol.encode(draw(SOUND)))
    at, other = draw(st.integers(0, len(wire) - 1)), draw(BYTE)
    match draw(st.integers(0, 3)):
        case 0:
            wire[at] = other
        case 1:
            del wire[at : at + draw(st.integers(1, 300))]
        case 2:
            wire[at:at] = bytes([other]) * draw(st.integers(1, 300))
        case 3:
            wire[at] ^= 1 << draw(st.integers(0, 7))
    return bytes(wire)


STREAMS = st.lists(
    st.one_of(SOUND.map(scanner_protocol.encode), damaged(), st.binary(max_size=40), st.sampled_from([b"\0", b"\0\0"])),
    max_size=8,
).map(b"".join)


@given(SOUND)
def test_a_frame_is_encoded_as_pythons(frames: Frames, sound: Frame) -> None:
    assert frames.encode(sound) == scanner_protocol.encode(sound)


@given(STREAMS)
@example(b"\x01" * 254 + b"\0")
@example(b"\x01" * 255 + b"\0")
@example(b"\x01" * 256 + b"\0")
@example(b"\xff" * 255 + b"\0")
@example(b"\xff" * 256 + b"\0" + scanner_protocol.encode(Frame(1, 2, b"")))
@example(b"\x01" * 1000 + b"\0\0" + scanner_protocol.encode(Frame(1, 2, bytes(250))))
@example(b"\x04\xff\xff\x01\0")  # of three bytes
@example(b"\x03\xff\xff\x01\0")  # two zeros at the end
def test_of_any_stream_it_makes_the_frames_and_the_counts_that_python_makes(frames: Frames, stream: bytes) -> None:
    python = scanner_protocol.FrameDecoder()
    expected = python.feed(stream)
    found, lengths, outcomes = frames.decode(stream)
    assert lengths == [len(frame.payload) for frame in expected]
    assert found == [Frame(frame.kind, frame.sequence, frame.payload[: frames.kept]) for frame in expected]
    counts = python.counts
    assert outcomes[1:] == [counts.frames, counts.damaged, counts.short, counts.overlong]


@given(STREAMS, SOUND)
def test_after_an_end_it_is_in_step_again(frames: Frames, stream: bytes, sound: Frame) -> None:
    found, lengths, _ = frames.decode(stream + b"\0" + scanner_protocol.encode(sound))
    assert found[-1] == Frame(sound.kind, sound.sequence, sound.payload[: frames.kept])
    assert lengths[-1] == len(sound.payload)
