"""Hard cases: numerical dangers, a reference for each, and the measured error."""
