"""Names as ROS 2 has them, and the domain that its nodes are in."""

import os
import re

from thenar.drivers.errors import SettingError

_MAX_DOMAIN = 232  # above it the ports of DDS would pass 65535
_MAX_LENGTH = 200


def namespace(name: str) -> str:
    """Return `name` if topics can stand under it, as "/thenar" or "/lab/left_hand". Raises SettingError."""
    fits = re.fullmatch(r"(?:/[A-Za-z][A-Za-z0-9_]*)+", name) and "__" not in name and len(name) <= _MAX_LENGTH
    if not fits:
        raise SettingError(f"ros:{name} is no name of ROS: write it as ros:/thenar, with letters, digits and single _")
    return name


def dds_topic(name: str) -> str:
    """Return what DDS calls the ROS topic `name`: "/thenar/grasp" is "rt/thenar/grasp"."""
    return f"rt{name}"


def domain() -> int:
    """Return the domain that the environment variable ROS_DOMAIN_ID names, or 0. Raises SettingError."""
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isdecimal() or int(text) > _MAX_DOMAIN:
        raise SettingError(f"ROS_DOMAIN_ID is {text!r}: it is a whole number from 0 to {_MAX_DOMAIN}, or not set")
    return int(text)
