"""ROS 2 through Eclipse Cyclone DDS (extra `ros`): its names, its messages, its domain."""

from thenar.drivers.extras import optional

with optional():
    import cyclonedds  # noqa: F401
