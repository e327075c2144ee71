"""`try.html`: a build to be tried in a browser, in one file, without a server or a network."""
