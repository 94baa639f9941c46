"""Entry point `python -m companion.cli`: the command line without its installed script."""

from companion.cli.program import main

main()
