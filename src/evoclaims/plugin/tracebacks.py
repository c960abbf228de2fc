"""Tracebacks of what a project's methods and tasks raise, without the engine's frames between the project's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.raised import is_in_project


def shortened(excinfo: pytest.ExceptionInfo[BaseException], item: pytest.Item) -> Any:
    """Return how pytest shows an exception, without the frames of other files before the project's last one.

    None where only one of the project's files, the claim's, is among the frames: the error may be of evoclaims, and all
    that pytest shows stays. So it does with --full-trace.
    """
    root, entries = item.config.rootpath, list(excinfo.traceback)
    of_project = [place for place, entry in enumerate(entries) if is_in_project(Path(entry.path), root)]
    if item.config.getoption("fulltrace") or len({entries[place].path for place in of_project}) < 2:
        return None
    kept = {id(entries[place]) for place in of_project} | set(map(id, entries[of_project[-1] :]))
    style = item.config.getoption("tbstyle")
    return excinfo.getrepr(
        style="long" if style == "auto" else style,
        showlocals=item.config.getoption("showlocals"),
        tbfilter=lambda info: info.traceback.filter(lambda entry: id(entry) in kept),
    )
