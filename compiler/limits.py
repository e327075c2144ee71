"""Limits that are checked before the work starts: the size of a build, and the memory of a training."""

import os

from thenar.drivers.errors import ThenarError
from thenar.runtime.model.integers import MAX_BYTES, MAX_CLASSES, MAX_JOINTS, MAX_SWITCHES, payload_bytes

# Numbers of (types, rows) arrays in a round of boosting, and of a training's columns with two values and with more.
_BYTES_A_TYPE_AND_ROW, _BYTES_A_SWITCH_AND_ROW, _BYTES_A_JOINT_AND_ROW = 120, 10, 60


def check_types(types: int, raises: type[ThenarError]) -> None:
    """Raise `raises` if the recordings hold more grasp types than a build can."""
    if types > MAX_CLASSES:
        raise raises(
            f"the recordings hold {types} grasp types, a build has at most {MAX_CLASSES}: join types, or leave some out"
        )


def check_inputs(types: int, switches: int, joints: int, raises: type[ThenarError]) -> None:
    """Raise `raises` if no build has room for these numbers of switches and joints."""
    if switches > MAX_SWITCHES:
        raise raises(f"{switches} switches, a build has at most {MAX_SWITCHES}: keep fewer")
    if joints > MAX_JOINTS:
        raise raises(f"{joints} joints, a build has at most {MAX_JOINTS}: import fewer, or use switches alone")
    least = payload_bytes(types, switches, [0] * joints)
    if least > MAX_BYTES:
        raise raises(
            f"tables of {types} grasp types, {switches} switches and {joints} joints need {least} bytes at least, a "
            f"build has at most {MAX_BYTES}: keep fewer switches"
        )


def check_memory(rows: int, types: int, raises: type[ThenarError], switches: int = 0, joints: int = 0) -> None:
    """Raise `raises` if training on `rows` rows needs more memory than this machine has."""
    a_row = _BYTES_A_TYPE_AND_ROW * types + _BYTES_A_SWITCH_AND_ROW * switches + _BYTES_A_JOINT_AND_ROW * joints
    needed, there = rows * a_row, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if needed > there:
        raise raises(
            f"training on {rows} rows of {types} grasp types needs some {needed / 1e9:.1f} GB of memory, this machine "
            f"has {there / 1e9:.1f}: take fewer rows or columns"
        )
