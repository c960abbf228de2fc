"""Tracebacks of what a project's methods and tasks raise, without the engine's frames between the project's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.raised import is_in_project


def shortened(excinfo: pytest.ExceptionInfo[BaseException], item: pytest.Item) -> Any:
    """Return how pytest shows an exception, without the frames of other files before the project's last one.

    None where only one of the project's files, the claim's, is among the frames: the error may be of evoclaims, and all
    that pytest shows stays. So it does with --full-trace, and without pytest's terminal, which defines how it is shown.
    """
    if not item.config.pluginmanager.has_plugin("terminal"):
        return None
    root, style = item.config.rootpath, item.config.getoption("tbstyle")
    files = {entry.path for entry in excinfo.traceback if is_in_project(Path(entry.path), root)}
    if item.config.getoption("fulltrace") or len(files) < 2:
        return None

    def kept(info: pytest.ExceptionInfo[BaseException]) -> Any:
        """Return the frames to show, also of an exception that caused this one."""
        entries = list(info.traceback)
        of_project = [place for place, entry in enumerate(entries) if is_in_project(Path(entry.path), root)]
        last = of_project[-1] if of_project else 0
        shown = {id(entry) for place, entry in enumerate(entries) if place in of_project or place >= last}
        return info.traceback.filter(lambda entry: id(entry) in shown)

    showlocals = item.config.getoption("showlocals")
    return excinfo.getrepr(style="long" if style == "auto" else style, showlocals=showlocals, tbfilter=kept)
