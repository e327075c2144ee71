"""The pages of a build, each in one file that works offline: `report.html` shows it, `try.html` lets one try it."""
