"""Pages in a browser, of a run or of its recording: the server and what it shows (extra `web`)."""
