"""Accuracy: folds, protocols, intervals, and the paper's tables for the user's data."""
