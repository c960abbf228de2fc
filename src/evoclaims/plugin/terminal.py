"""The terminal of a pytest run, past its capture."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import pytest


class Uncaptured:
    """The terminal behind pytest's capture, for a progress line that is seen while a claim's trials run."""

    def __init__(self, config: pytest.Config) -> None:
        """Look at what the terminal is."""
        self._capture: Any = config.pluginmanager.get_plugin("capturemanager")
        self._writer = config.get_terminal_writer()
        self.fullwidth = self._writer.fullwidth
        self.hasmarkup = self._writer.hasmarkup

    def write(self, msg: str, *, flush: bool = False) -> None:
        """Write text as it is."""
        with self._capture.global_and_fixture_disabled() if self._capture else nullcontext():
            self._writer.write(msg, flush=flush)
