"""Templates of the C99 firmware generated from a build."""
