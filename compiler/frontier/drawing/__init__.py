"""A frontier as pictures, as a table, and in words."""
