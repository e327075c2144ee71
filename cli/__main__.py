"""Let `python -m thenar.cli` run `thenar`."""

from . import main

main()
