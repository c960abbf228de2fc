"""A reproduction's figures are found by name, and imported when asked for."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.figures import figure

FIGURE = """
from evoclaims.figures.figure import Figure
FIGURE = Figure(name="{name}", title="A title", where="§1", paint=None)
"""


@pytest.fixture
def reproduction(paper: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The paper with three modules: a figure, one of another name, and an empty one."""
    package = tmp_path / "drawn_paper"
    package.mkdir()
    for name, text in {"fig1": FIGURE.format(name="fig1"), "fig2": FIGURE.format(name="figure2"), "fig3": ""}.items():
        (package / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield replace(paper.reproduction, figures=tuple(f"drawn_paper.fig{i}" for i in (1, 2, 3)))
    for module in [name for name in sys.modules if name.startswith("drawn_paper")]:
        del sys.modules[module]


def test_a_figure_is_imported_when_it_is_asked_for_and_has_the_name_of_its_module(reproduction: Any) -> None:
    assert figure.names(reproduction) == ("fig1", "fig2", "fig3")
    assert figure.load(reproduction, "fig1").title == "A title"
    assert "drawn_paper.fig2" not in sys.modules
    for name in ("fig2", "fig3"):
        with pytest.raises(UserError, match=f"'drawn_paper.{name}' has no FIGURE"):
            figure.load(reproduction, name)


@pytest.mark.parametrize("name", ["fig2", "fig3"])
def test_a_module_without_a_figure_of_its_name_is_said(reproduction: Any, name: str) -> None:
    with pytest.raises(UserError, match=f"'drawn_paper.{name}' has no FIGURE"):
        figure.load(reproduction, name)
