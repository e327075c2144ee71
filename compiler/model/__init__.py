"""Collapse an ensemble of stumps to score tables, and quantise those to integers with proved bounds."""
