"""The kinds of terms: a file each."""
