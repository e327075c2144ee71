"""Labelled grasps: the set, its file format, imports and exports. Needs only the base dependencies."""
