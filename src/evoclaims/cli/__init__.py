"""The command line: `evoclaims COMMAND`, each in a module of its name.

Before trials: plan, run, submit, jobs. Verdicts: status, audit, accept, compare, report, export. Evidence:
reproduce, champion, look. Releases of libraries: across, bisect. Files: merge, verify, reference.
"""

from evoclaims.cli.main import main

__all__ = ["main"]
