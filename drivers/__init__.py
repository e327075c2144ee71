"""Wire protocols of gloves and scanners, one a file. Imports nothing else of thenar."""
