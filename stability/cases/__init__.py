"""The hard cases, one a module: `findings(full)` runs it."""
