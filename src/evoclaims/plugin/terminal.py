"""The terminal of a pytest run, past its capture."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import pytest


def uncaptured(config: pytest.Config) -> tuple[Callable[[str], None], int | None]:
    """Return what writes behind pytest's capture, for a line that is seen while trials run, and a terminal's columns.

    The columns are None where there is no terminal to rewrite a line on.
    """
    capture: Any = config.pluginmanager.get_plugin("capturemanager")
    writer = config.get_terminal_writer()

    def write(text: str) -> None:
        with capture.global_and_fixture_disabled() if capture else nullcontext():
            writer.write(text, flush=True)

    return write, writer.fullwidth if writer.hasmarkup else None
