"""Placements better than the paper's, and the strong rivals they are held beside."""
