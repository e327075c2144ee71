"""`report.html`: everything known about a build, in one file that works offline."""
