"""A paper whose trials are made by hand."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_paper import Paper


@pytest.fixture
def paper(tmp_path: Path) -> Paper:
    """The paper, with no trials yet."""
    return Paper(tmp_path)
