"""The terminal of a pytest run, past its capture."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import pytest


def uncaptured(config: pytest.Config) -> tuple[Callable[[str], None], int | None]:
    """Return a function that writes past pytest's capture, for a line shown while trials run, and a terminal's columns.

    The columns are None if there is no terminal on which to rewrite a line.
    """
    capture: Any = config.pluginmanager.get_plugin("capturemanager")
    writer = config.get_terminal_writer()

    def write(text: str) -> None:
        with capture.global_and_fixture_disabled() if capture else nullcontext():
            writer.write(text, flush=True)

    return write, writer.fullwidth if writer.hasmarkup else None
