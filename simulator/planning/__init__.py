"""Planned postures: how hands of any length hold each object, made once and kept as data."""
