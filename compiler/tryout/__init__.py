"""`try.html`: a build to try out in a browser, in one file, without a server or a network."""
