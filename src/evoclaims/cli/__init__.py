"""The command line: `evoclaims plan | run | champion | look | status | verify | reference`."""

from evoclaims.cli.main import main

__all__ = ["main"]
