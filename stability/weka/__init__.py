"""Weka 3.6 as a program, and thenar beside it."""
