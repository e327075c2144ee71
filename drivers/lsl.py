"""The Lab Streaming Layer package, an optional dependency (extra `lsl`)."""

import os
from typing import TYPE_CHECKING

from .errors import SettingError
from .extras import optional

if TYPE_CHECKING:
    from types import ModuleType

_THIS_MACHINE = b"[multicast]\nResolveScope=machine\nListenAddress=127.0.0.1\n[ports]\nIPv6=disable\n[log]\nlevel=-3\n"


def load_pylsl(place: str) -> "ModuleType":
    """Return pylsl. Raises SettingError if it, or the library that it wraps, is not installed."""
    try:
        with optional(SettingError, place):
            import pylsl
            import pylsl.util
    except (ImportError, RuntimeError, OSError) as reason:  # the library that pylsl wraps is missing
        raise SettingError(f"{place}: pylsl cannot load its library: {reason}") from None
    if "LSLAPICFG" not in os.environ:
        pylsl.lib.lib.lsl_set_config_content(_THIS_MACHINE)  # effective only before the first stream of a process
    return pylsl  # type: ignore[no-any-return]
