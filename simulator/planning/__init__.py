"""Planned postures of hands of any length for each object, computed once and stored as data."""
