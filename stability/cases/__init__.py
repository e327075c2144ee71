"""The hard cases, one a module: `CASE` says what it is, `findings(full)` runs it."""
