"""Types of ROS 2's messages for Cyclone DDS, made from ROS's definitions as rosbags has them, not from thenar's."""

from functools import cache
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
GRASP = Path(__file__).parents[3] / "runtime" / "thenar_msgs" / "msg" / "Grasp.msg"
STORE.register(get_types_from_msg(GRASP.read_text("utf-8"), "thenar_msgs/msg/Grasp"))


@cache
def kind_of(name: str) -> Any:
    """Return the type of std_msgs/String."""
    from cyclonedds.idl import make_idl_struct

    package, _, short = name.partition("/")
    _, defined = STORE.fielddefs[f"{package}/msg/{short}"]
    fields = {field: type_of(*kind) for field, kind in defined}
    return make_idl_struct(short, f"{package}::msg::dds_::{short}_", fields)


def type_of(node: Any, inner: Any) -> Any:
    from cyclonedds.idl import types

    if node == Nodetype.SEQUENCE:
        sequence: Any = types.sequence
        return sequence[type_of(*inner[0])]
    if node == Nodetype.NAME:
        return kind_of(inner.replace("/msg/", "/"))
    return str if inner[0] == "string" else getattr(types, inner[0])
