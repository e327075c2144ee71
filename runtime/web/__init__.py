"""Pages in a browser, of a run or of its recording: the server and the views (extra `web`)."""
