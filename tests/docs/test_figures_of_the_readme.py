"""The pictures that README shows are what `evoclaims reproduce` draws from the committed trials."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest

from evoclaims.cli import main

ROOT = Path(__file__).parents[2]


@pytest.mark.oldest
@pytest.mark.parametrize(
    ("picture", "variant"), [("figure3", ()), ("figure3-published_rows_so_far", ("--variant", "published_rows_so_far"))]
)
def test_figure_3_is_drawn_from_the_committed_trials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, picture: str, variant: tuple[str, ...]
) -> None:
    committed = (ROOT / "docs" / f"{picture}.svg").read_text(encoding="utf-8")
    if f"Matplotlib v{version('matplotlib')}," not in committed:
        pytest.skip("another release of Matplotlib draws other paths")
    monkeypatch.chdir(ROOT)
    (tmp_path / "store").mkdir()
    assert main(["reproduce", "fig3", "--tier=full", *variant, f"--storage={tmp_path}/store", f"--out={tmp_path}"]) == 0
    drawn = (tmp_path / "fig3.svg").read_text(encoding="utf-8")
    assert drawn == committed, f"evoclaims reproduce fig3 --tier full {' '.join(variant)} draws another {picture}.svg"
