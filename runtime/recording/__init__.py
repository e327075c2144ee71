"""Raw frames in MCAP files, which survive whatever ends the process."""
