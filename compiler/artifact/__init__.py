"""The build folder: compiled, and verified against what was trained."""
