"""Questions asked once: answers kept in a file, found in workers."""
