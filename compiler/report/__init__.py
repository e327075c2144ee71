"""`report.html`: all that a build knows of itself, in one file that works offline."""
