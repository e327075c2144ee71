"""What people are shown: the page, its pictures, and what these are measured from."""
