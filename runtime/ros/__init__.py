"""ROS 2 through Eclipse Cyclone DDS (extra `ros`): its names, its messages, its domain."""
