"""A scene or a recording played on emulated devices, in real time."""
