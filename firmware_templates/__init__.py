"""Templates of the C99 firmware that a build is turned into."""
