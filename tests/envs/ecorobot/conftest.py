"""A package of a user's robots for each test."""

from __future__ import annotations

from pathlib import Path

import pytest
from custom_robots import Texts


@pytest.fixture
def texts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Texts:
    return Texts(tmp_path, monkeypatch)
