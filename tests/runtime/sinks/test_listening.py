"""Where to listen: no other machine is let in unless that is meant."""

import contextlib
import re
import socket
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.published import LiveGrasp
from thenar.runtime.sinks import SinkError
from thenar.runtime.sinks.sockets import open_tcp


def test_a_port_in_use_is_told_and_free_again_afterwards(make_grasp: Callable[..., LiveGrasp]) -> None:
    first = open_tcp("127.0.0.1:0")
    port = first.address[1]
    with pytest.raises(SinkError, match="another process serves that port"):
        open_tcp(f"127.0.0.1:{port}")
    with socket.create_connection(("127.0.0.1", int(port))) as reader:
        first.publish(make_grasp(), None, None)
        assert reader.recv(1 << 16)
        first.close()  # this side first: the system keeps the connection's end for a minute
    second = open_tcp(f"{port}")
    assert second.address == ("127.0.0.1", port)
    second.close()


@pytest.mark.parametrize("place", ["0.0.0.0:0", "[::]:0"])
def test_other_machines_are_let_in_only_where_that_is_said(place: str) -> None:
    with pytest.raises(SettingError, match=re.escape(f"write tcp:{place}?public")):
        open_tcp(place)
    open_tcp(place, public=True).close()


@pytest.mark.parametrize(
    "place", ["", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "::1:7777", "127.0.0.1:-1", "a b:1"]
)
def test_what_is_no_address_is_refused(place: str) -> None:
    with pytest.raises(SettingError, match="tcp:"):
        open_tcp(place)


def test_a_host_that_is_not_there_is_refused() -> None:
    with pytest.raises(SettingError, match="there is no host"):
        open_tcp(f"{'x' * 64}:7777")  # longer than any part of a host's name, so that no server is asked


def test_an_address_of_ipv6_stands_in_brackets() -> None:
    with contextlib.suppress(SinkError):  # a machine may be without IPv6
        sink = open_tcp("[::1]:0")
        assert sink.address[0] == "::1"
        sink.close()


@given(st.text(st.characters(exclude_characters="0123456789/"), max_size=8))
def test_no_text_raises_anything_but_our_own_errors(text: str) -> None:
    with pytest.raises(ThenarError):
        open_tcp(text)
