"""The page, its pictures, and their measurements."""
