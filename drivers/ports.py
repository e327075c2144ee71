"""Ports: which texts name a port, and which file may be opened as one. A port may come from an untrusted file.

pySerial accepts more than serial lines: `spy://` writes to any file, `alt://` loads any of its classes.
"""

import errno
import os
import re
import stat
from pathlib import Path

from .errors import DeviceError, SettingError
from .names import shortened

_SOCKET = re.compile(r"socket://(?:[a-z0-9._-]+|\[[0-9a-f:.]+(?:%[a-z0-9._-]+)?\]):0*([1-9][0-9]{0,4})/?", re.I | re.A)
_WAYS = "a port is a device such as /dev/ttyUSB0 or socket://HOST:PORT"


def port_fault(port: str) -> str:
    """Return why `port` does not name a serial line, or ""."""
    scheme, found, _ = port.partition("://")
    if not found:
        return device_fault(port)
    if scheme.lower() != "socket":
        return f"is not a supported port: {_WAYS}"
    address = _SOCKET.fullmatch(port)
    return "" if address and int(address[1]) < 65536 else f"is not the address of a line: {_WAYS}"


def device_fault(path: str) -> str:
    """Return why `path` cannot be a device node, or ""."""
    if not path:
        return f"is empty: {_WAYS}"
    if "://" in path or not path.isprintable():
        return "is not the path of a device, such as /dev/ttyUSB0 or /dev/i2c-1"
    return ""


def check_device(path: str) -> None:
    """Raise SettingError if `path` is not the path of a device."""
    if fault := device_fault(path):
        raise SettingError(f"{shortened(repr(path))} {fault}")


def cause(error: OSError, kind: str, missing: str) -> str:
    """Return why the node of a bus of this kind, such as "I2C", cannot be used; `missing` is for one that is gone."""
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return missing
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"permission denied; is your user in the group {kind.lower()}?"
    return f"{os.strerror(error.errno or errno.EIO)}; is it an {kind} device?"


def check_node(path: str) -> None:
    """Raise DeviceError unless `path` is a device: opening a file would lock it or treat it as a device.

    A path that is missing or unreadable is not an error here: opening it reports that.
    """
    try:
        mode = Path(path).stat().st_mode
    except OSError:
        return
    if not stat.S_ISCHR(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a file" if stat.S_ISREG(mode) else "not a character device"
        raise DeviceError(f"{path} is {kind}, not a device: it was left as it is")
