"""I2C port expanders: one chip a file, one bus over all of them."""
