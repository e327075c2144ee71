"""`python -m thenar.cli` is `thenar`."""

from . import main

main()
