import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.ports import device_fault, port_fault

GOOD = [
    *("/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0", "COM3", "left glove/port", "/dev/pts/3"),
    *("socket://127.0.0.1:7000", "SOCKET://glove-1.lab:1", "socket://[::1]:65535/", "socket://[fe80::1%eth0]:80"),
]
BAD = [
    *("", "a\0b", "a\nb", "/dev/tty\x1b[2J", "spy:///dev/ttyUSB0?file=/etc/passwd", "alt://x?class=Serial", "://x:1"),
    *("socket://127.0.0.1", "socket://:7000", "socket://h:0", "socket://h:65536", "socket://h:x", "socket://h:1/path"),
    *("socket://h:1?logging=debug", "socket://h:1#x", "socket://me@h:1", "socket://a\nb:1", "socket://h h:1"),
    *("rfc2217://pi:2217", "socket://h:1?timeout=2.5", "socket://[h]:1", "socket://h:1" + "?a&" * 99),
    *("socket://\u0660:1", "/dev/x spy://y"),
]


@pytest.mark.parametrize("port", GOOD)
def test_devices_and_sockets_are_ports(port: str) -> None:
    assert port_fault(port) == ""


@pytest.mark.parametrize("port", BAD)
def test_whatever_else_pyserial_might_make_of_a_text_is_none(port: str) -> None:
    assert port_fault(port)


@given(st.text(), st.sampled_from(["", "spy", "socket", "rfc2217", "hwgrep"]), st.text())
def test_no_text_is_a_port_of_another_scheme(before: str, scheme: str, after: str) -> None:
    port = f"{before}{scheme}://{after}"
    assert device_fault(port)
    assert port_fault(port) or port.lower().startswith("socket://")
