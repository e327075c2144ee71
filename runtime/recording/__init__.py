"""Raw frames in MCAP files that survive however the process ends."""
