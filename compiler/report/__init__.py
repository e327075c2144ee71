"""The page of a build, in one file that works offline: a summary, a report, and a try."""
