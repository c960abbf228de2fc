"""The command line: `evoclaims plan | run | champion | status | verify | reference`."""

from evoclaims.cli.main import main

__all__ = ["main"]
