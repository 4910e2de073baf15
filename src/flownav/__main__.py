"""`python -m flownav`."""

from flownav.cli import main

main()
