"""Emulated devices, which speak bytes: for tests, for the demo, and for whoever has no glove at hand."""
