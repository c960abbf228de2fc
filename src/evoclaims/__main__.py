"""`python -m evoclaims COMMAND`: the command line, by the Python that is to run it."""

from evoclaims.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
