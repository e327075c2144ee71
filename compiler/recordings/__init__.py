"""Labelled grasps: the set, its file, and the ways in and out. Needs only the base dependencies."""
