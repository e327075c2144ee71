"""thenar_datagram.c by itself: which datagrams a board takes, and whom it answers. Times and numbers wrap."""

import ctypes
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware.protocol import BoardConfig, protocol_files
from thenar.drivers import scanner_protocol
from thenar.drivers.scanner_datagrams import FROM_BOARD, TO_BOARD, Datagrams
from thenar.drivers.scanner_protocol import Event, Frame, Ping, frame
from thenar.firmware_templates.rendering import render

BOOT, SILENT_US = 0xCAFE, 2_000_000
PING = scanner_protocol.encode(frame(Ping(9), 0))
EVENT = scanner_protocol.encode(frame(Event(1, 2, 1), 0))


class Peer(ctypes.Structure):
    _fields_ = (("address", ctypes.c_uint32), ("port", ctypes.c_uint16))


HOST, OTHER = Peer(0x0100007F, 4000), Peer(0x0100007F, 4001)


class Line:
    """The C, with a clock."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._c, self.now_us = library, 2**32 - 500_000
        self._c.thenar_datagram_begin(ctypes.c_uint32(BOOT))

    def take(self, datagram: bytes, peer: Peer = HOST) -> bool:
        now = ctypes.c_uint32(self.now_us)
        return bool(self._c.thenar_datagram_take(datagram, ctypes.c_uint16(len(datagram)), ctypes.byref(peer), now))

    def ping(self, number: int, peer: Peer = HOST, session: int = 5) -> bool:
        return self.take(TO_BOARD.pack(0x54, 1, session, number % 2**32) + PING, peer)

    def wrap(self, whole: bytes = EVENT) -> tuple[bytes, int]:
        room, peer = ctypes.create_string_buffer(300), Peer()
        now = ctypes.c_uint32(self.now_us)
        size = self._c.thenar_datagram_wrap(room, whole, ctypes.c_uint8(len(whole)), ctypes.byref(peer), now)
        return room.raw[:size], peer.port


@pytest.fixture(scope="module")
def library(tool: Callable[[str], str], tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("datagram")
    files = protocol_files(BoardConfig(1, 8))
    files |= {f"thenar_datagram.{end}": render(f"board/thenar_datagram.{end}.j2") for end in "hc"}
    for name, text in files.items():
        (folder / name).write_text(text)
    strict = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-fPIC", "-shared")
    sources = [str(folder / name) for name in ("thenar_datagram.c", "thenar_frames.c")]
    subprocess.run([tool("gcc"), *strict, *sources, "-o", str(folder / "line.so")], check=True)
    library = ctypes.CDLL(str(Path(folder / "line.so")))
    library.thenar_datagram_take.restype = ctypes.c_bool
    library.thenar_datagram_wrap.restype = ctypes.c_uint16
    return library


@pytest.fixture
def line(library: ctypes.CDLL) -> Line:
    return Line(library)


def test_nobody_is_answered_before_somebody_asked(line: Line) -> None:
    assert line.wrap()[0] == b""
    assert line.ping(1)
    datagram, port = line.wrap()
    assert FROM_BOARD.unpack_from(datagram) == (0x54, 1, 5, BOOT, 1, 1, 0)
    assert datagram[FROM_BOARD.size :] == EVENT
    assert port == 4000


def test_the_end_alone_is_no_frame_and_takes_no_number(line: Line) -> None:
    line.ping(1)
    assert line.wrap(b"\0")[0] == b""
    assert FROM_BOARD.unpack_from(line.wrap()[0])[4] == 0


def test_numbers_go_on_beyond_a_frames_own(line: Line) -> None:
    line.ping(1)
    driver = Datagrams(5)
    for number in range(600):
        datagram, _ = line.wrap(scanner_protocol.encode(frame(Event(1, 2, 1), number)))
        assert [type(each) for each in driver.take(datagram)] == [Frame]


@pytest.mark.parametrize("first", [1, 2**31 - 3, 2**32 - 4])
def test_only_newer_numbers_are_taken(line: Line, first: int) -> None:
    order = (0, 2, 1, 2, 0, 5, 4, 6, 2**31 + 6, 2**31 + 7, 2**31 + 5, 6)
    taken = [at for at, each in enumerate(order) if line.ping(first + each)]
    assert taken == [0, 1, 5, 7, 10]


@pytest.mark.parametrize("first", [1, 2**32 - 20])
def test_it_says_what_it_has_heard(line: Line, first: int) -> None:
    random = np.random.default_rng(first)
    heard = {first}
    line.ping(first)
    for number in first + 1 + np.flatnonzero(random.random(120) < 0.6):
        line.ping(int(number))
        heard.add(int(number))
        _, _, _, _, _, newest, before = FROM_BOARD.unpack_from(line.wrap()[0])
        assert newest == number % 2**32
        assert [bool(before >> bit & 1) for bit in range(32)] == [int(number) - 1 - bit in heard for bit in range(32)]


@pytest.mark.parametrize("jump", [31, 32, 33, 64, 1 << 20])
def test_a_jump_forgets_what_is_too_far_back(line: Line, jump: int) -> None:
    line.ping(7)
    line.ping(7 + jump)
    assert FROM_BOARD.unpack_from(line.wrap()[0])[6] == (1 << (jump - 1) if jump <= 32 else 0)


def test_another_host_is_heard_once_the_first_is_silent_or_has_gone(line: Line) -> None:
    assert line.ping(1)
    assert not line.ping(50, OTHER)
    assert not line.ping(50, HOST, session=6), "the same place, another program"
    line.now_us += SILENT_US - 1  # the clock wraps here
    assert not line.ping(51, OTHER, session=6)
    line.now_us += 1
    assert line.wrap()[0] == b"", "a host that is silent is sent nothing"
    assert line.ping(1, OTHER, session=6)
    assert not line.take(TO_BOARD.pack(0x54, 1, 5, 9)), "a farewell of somebody else"
    assert line.wrap()[1] == 4001
    assert not line.take(TO_BOARD.pack(0x54, 1, 6, 9), OTHER)
    assert line.wrap()[0] == b""
    assert line.ping(2)


def test_a_host_that_was_silent_goes_on_where_it_was(line: Line) -> None:
    line.ping(10)
    line.now_us += SILENT_US
    assert not line.ping(10), "what came then is no sign of life now"
    assert line.ping(11)


def test_garbage_is_not_taken(line: Line) -> None:
    random, head = np.random.default_rng(2), TO_BOARD.pack(0x54, 1, 5, 1)
    wrong = [PING[:-1], PING + b"\0", PING * 2, b"\0", b"\0" + PING, PING[:3] + b"\x55" + PING[4:], b"\1" * 300]
    assert not any(line.take(head + each) for each in wrong)
    assert not any(line.take(head[:size]) for size in range(len(head)))
    assert not line.take(b"U" + head[1:] + PING)
    assert not line.take(head[:1] + b"\2" + head[2:] + PING)
    assert not any(line.take(head + random.bytes(int(size))) for size in random.integers(0, 268, 3000))
    assert line.wrap()[0] == b""
    assert line.take(head + PING)
