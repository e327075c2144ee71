"""The harness: which switch hangs on which pin of which chip, as `glove.toml` says."""
