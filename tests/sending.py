"""What sends while a test listens, and where to."""

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread


def free_port() -> int:
    """Return a UDP port of this machine at which nobody listens."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    return port


@contextmanager
def sending(send: Callable[[int], object], every_s: float = 0.01) -> Iterator[None]:
    """Call `send` with 1, 2 and so on in another thread, until the block ends."""
    done = Event()

    def go() -> None:
        number = 0
        while not done.wait(every_s):
            send(number := number + 1)

    thread = Thread(target=go)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


@contextmanager
def datagrams(port: int, datagram: Callable[[int], bytes], every_s: float = 0.01) -> Iterator[None]:
    """Send datagrams 1, 2 and so on to a port of this machine, until the block ends."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line,
        sending(lambda number: line.sendto(datagram(number), ("127.0.0.1", port)), every_s),
    ):
        yield
