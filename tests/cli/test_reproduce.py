"""`evoclaims reproduce`: what it writes, prints and returns."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
import tiny_project
from tiny_project import Evoclaims, Project, forget, trials_of

from evoclaims.core.drawing import optional
from evoclaims.trials.store import Store

# What the command imports late: pytester forgets the modules that a test has imported, and would load them twice.
for _module in ("backends.backend_agg", "backends.backend_svg", "figure", "lines", "patches", "textpath"):
    optional(f"matplotlib.{_module}")
for _module in ("pandas", "scipy.stats", "evoclaims.cli.reproduce", "evoclaims.figures.bars"):
    optional(_module)

FIGURES = 'REPRODUCTION = replace(REPRODUCTION, figures=("fig1", "fig2"))'
FIGURE = """
from evoclaims.figures.bar_panel import Series
from evoclaims.figures.bars import BarChart, compared
from evoclaims.figures.figure import Figure
from evoclaims.paper.reported import Published

METHODS = tuple(Series(name, name, "#0072b2") for name in {methods})
PANEL = compared(
    "success", lambda t: t.mean_success, METHODS, {{"": "parity"}}, Published({{}}, {{}}), ylabel="success"
)
FIGURE = Figure(name="{name}", title="Success", where="§1, Fig. 1", paint=BarChart((PANEL,)))
"""


@pytest.fixture(autouse=True)
def _figures(project: Project) -> None:
    """The project has two figures."""
    files = {"fig1": ("right", "wrong"), "fig2": ("coin",)}
    modules = {name: FIGURE.format(name=name, methods=methods) for name, methods in files.items()}
    project.pytester.makepyfile(tiny_paper=tiny_project.REPRODUCTION + FIGURES, **modules)


@pytest.fixture
def half(evoclaims: Evoclaims, stored: Store) -> Evoclaims:
    """A function that runs a command where one bar of the first figure has all its trials, and the other none."""
    forget(stored, trials_of(stored, "hand_built_negated"))
    return evoclaims


def test_a_figure_is_written_three_ways_and_what_is_missing_is_said(half: Evoclaims) -> None:
    status, out, err = half("reproduce", "fig1")
    assert (status, err) == (0, "")
    assert out.splitlines() == ["fig1: wrote figures/smoke/fig1.png, .svg and .csv", "  Not run: wrong on parity."]
    folder = Path("figures/smoke")
    assert (folder / "fig1.png").read_bytes().startswith(b"\x89PNG")
    assert "not run" in (folder / "fig1.svg").read_text()
    assert len(re.findall(",parity,trial,", (folder / "fig1.csv").read_text())) == 20
    assert sorted(path.name for path in folder.iterdir()) == ["fig1.csv", "fig1.png", "fig1.svg"]


def test_all_figures_go_into_the_folder_that_is_named(half: Evoclaims) -> None:
    status, out, _ = half("reproduce", "all", "--out", "there/it")
    assert status == 0
    assert [line.partition(":")[0] for line in out.splitlines() if "wrote" in line] == ["fig1", "fig2"]
    assert len(list(Path("there/it").iterdir())) == 6
    assert not Path("figures").exists()


def test_a_figure_without_any_trial_is_written_and_ends_with_1(half: Evoclaims) -> None:
    status, out, _ = half("reproduce", "fig2", "--tier", "full")
    assert status == 1
    assert "not run" in Path("figures/full/fig2.svg").read_text()
    assert out.splitlines()[-1] == (
        "Nothing could be drawn: of fig2 no trial of the full tier is at hand. `evoclaims run METHOD --on TASK --tier "
        "full` runs them."
    )
    _, out, _ = half("reproduce", "fig2", "--tier", "full", "--variant", "traded")
    assert out.splitlines()[-1].endswith("`evoclaims run --tier full --variant traded` runs them.")


def test_committed_trials_are_drawn_where_the_store_has_none(half: Evoclaims) -> None:
    half("run", "wrong", "--device=cpu")
    assert half("reproduce", "fig1")[:2] == (0, "fig1: wrote figures/smoke/fig1.png, .svg and .csv\n")
    first = Path("figures/smoke/fig1.csv").read_bytes()
    assert half("reference")[0] == 0
    Path("empty").mkdir()
    assert half("reproduce", "fig1", "--storage=empty", "--out=again")[0] == 0
    assert Path("again/fig1.csv").read_bytes() == first


def test_a_users_mistake_is_one_sentence_and_status_2(evoclaims: Evoclaims) -> None:
    status, _, err = evoclaims("reproduce", "fig3")
    assert (status, err) == (
        2,
        "evoclaims: There is no figure named 'fig3'. Did you mean 'fig2'? Known: fig1, fig2.\n",
    )
    _, _, err = evoclaims("reproduce", "fig1", "--out", "pyproject.toml")
    assert err.startswith("evoclaims: Cannot write pyproject.toml/fig1.png: ")
    assert err.endswith("Name another folder with --out.\n")
    _, _, err = evoclaims("reproduce", "fig1", "--storage", "pyproject.toml")
    assert "The trial store pyproject.toml is a file, not a folder" in err


def test_a_project_without_figures_says_so(project: Project, evoclaims: Evoclaims) -> None:
    project.pytester.makepyfile(tiny_paper=tiny_project.REPRODUCTION)
    for name in ("fig1", "all"):
        status, _, err = evoclaims("reproduce", name)
        assert (status, "names no figures" in err) == (2, True)


def test_without_matplotlib_it_is_said_how_to_install_it(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.style", None)
    status, _, err = evoclaims("reproduce", "fig1")
    assert status == 2
    assert 'pip install "evoclaims[pictures]"' in err
    assert not Path("figures").exists()


def test_a_figure_under_a_variant_has_a_folder_of_its_own_and_says_if_it_is_not_changed(
    evoclaims: Evoclaims, stored: Store
) -> None:
    said = "  traded changes none of its trials: it is the same as without --variant"
    told = {name: evoclaims("reproduce", name, "--variant", "traded")[1] for name in ("fig1", "fig2")}
    assert [said in out.splitlines() for out in told.values()] == [False, True]
    assert told["fig1"].splitlines()[0] == "fig1: wrote figures/smoke-traded/fig1.png, .svg and .csv"
    assert "under traded" in Path("figures/smoke-traded/fig1.svg").read_text()
    assert said not in evoclaims("reproduce", "fig2")[1]
