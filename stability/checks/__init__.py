"""Shared by cases: computed values of hard inputs, their exact values, and bounds of rounding errors."""
