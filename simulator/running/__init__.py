"""A scene's sessions, simulated on all cores into a set of grasps and a report."""
