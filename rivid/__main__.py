"""``python -m rivid``."""

from rivid.cli import main

main()
