"""The harness: the chip and pin of every switch, read from `glove.toml`."""
