"""The laboratory of the tests of reports."""

from __future__ import annotations

from pathlib import Path

import pytest
from laboratory import Laboratory


@pytest.fixture
def lab(tmp_path: Path) -> Laboratory:
    """An empty one."""
    return Laboratory(tmp_path)


@pytest.fixture
def filled(lab: Laboratory) -> Laboratory:
    """One with six trials of two methods, the first always better."""
    lab.put("better", [1.0, 0.9, 0.9, 0.8, 0.8, 0.7])
    lab.put("worse", [0.1, 0.2, 0.3, 0.3, 0.4, 0.5])
    return lab
