"""Bar charts: what is drawn, said and tabulated."""

from __future__ import annotations

import io
import math
from typing import Any

import matplotlib as mpl
import pandas as pd
import pytest
from matplotlib.patches import Rectangle
from scipy.stats import mannwhitneyu
from small_paper import CONDITIONS, ONE, OTHER, collisions, told, words

from evoclaims.figures.bar_panel import Series
from evoclaims.figures.bars import BarChart, by_level, compared
from evoclaims.figures.figure import Drawing
from evoclaims.figures.sheet import contents
from evoclaims.paper.reported import Published
from evoclaims.trials.spec import TrialSpec

SILENT = Published({}, {})
PUBLISHED = Published(
    {
        "small": {
            "success": {"place": "Fig. 9", "methods": {"one": {"mean": [0.75, 0.25], "error": [0.125, 0.0]}}},
            "reward": {"place": "Fig. 9", "methods": {"one": {"mean": [4000.0], "error": [20.0]}}},
        }
    },
    {},
)
REWARD = ("reward", lambda trials: trials.reward, (ONE, OTHER))


def _levels(published: Published = SILENT, task: str = "small") -> BarChart:
    return BarChart((by_level(task, "A small task", (ONE, OTHER), published),))


def _rewards(published: Published = SILENT, **more: Any) -> BarChart:
    return BarChart((compared(*REWARD, {"": "small"}, published, ylabel="reward", **more),))


def _bars(drawing: Drawing) -> list[Rectangle]:
    return [patch for patch in drawing.figure.axes[0].patches if isinstance(patch, Rectangle)]


def test_every_trial_is_a_dot_and_a_row_of_the_table(paper: Any) -> None:
    ours, theirs = [i / 9 for i in range(10)], [2 + i / 21 for i in range(10)]
    paper.put("one", "small", ours)
    paper.put("other", "small", theirs)
    drawing = paper.draw(_rewards())
    assert [bar.get_height() for bar in _bars(drawing)] == pytest.approx([5, 20 + 45 / 21])
    trials = drawing.table[drawing.table["what"] == "trial"]
    ids = [TrialSpec(CONDITIONS[m, "small"], seed).id for m in ("one", "other") for seed in range(10)]
    assert list(trials["trial"]) == ids
    assert list(trials["value"]) == pytest.approx([10 * v for v in ours + theirs])
    dots = drawing.figure.axes[0].collections
    assert sum(len(group.get_offsets()) for group in dots if hasattr(group, "get_sizes")) == 20
    assert (drawing.shown, drawing.missing) == (20, ())
    again = pd.read_csv(io.BytesIO(contents(drawing)["csv"]))
    assert list(again[again["what"] == "trial"]["value"]) == list(trials["value"])  # to the last digit
    (test,) = drawing.table[drawing.table["what"] == "Mann-Whitney U"].to_dict("records")
    assert (test["series"], test["against"]) == ("The One", "The Other")
    assert test["value"] == mannwhitneyu(ours, theirs, alternative="two-sided").pvalue
    assert words(drawing).count("***") == 1
    assert "p < 0.05; * p < 0.05, ** p < 0.005, *** p < 0.0005" in told(drawing)


def test_methods_are_compared_at_each_place_and_each_with_itself_between_places(paper: Any) -> None:
    for i, (method, task) in enumerate(CONDITIONS):
        paper.put(method, task, [i + k / 100 for k in range(10)])
    places = {"narrow": "small", "wide": "large"}
    drawing = paper.draw(BarChart((compared(*REWARD, places, SILENT, ylabel="reward"),)))
    tests = drawing.table[drawing.table["what"] == "Mann-Whitney U"]
    assert sorted(zip(tests["series"], tests["at"], tests["against"], strict=True)) == [
        ("The One", "narrow", "The One wide"),
        ("The One", "narrow", "The Other narrow"),
        ("The One", "wide", "The Other wide"),
        ("The Other", "narrow", "The Other wide"),
    ]
    assert len(drawing.table[drawing.table["what"] == "Kruskal-Wallis"]) == 4


def test_what_has_not_run_is_said_and_has_no_bar(paper: Any) -> None:
    paper.put("one", "small", [0.5] * 10)
    drawing = paper.draw(_rewards())
    assert len(_bars(drawing)) == 1
    assert words(drawing).count("not run") == 1
    assert drawing.missing == ("Not run: other on small.",)
    assert "Not run: other on small." in told(drawing)
    absent = drawing.table[(drawing.table["series"] == "The Other") & (drawing.table["what"] == "trial")]
    assert set(absent["status"]) == {"not run"}
    assert absent["value"].isna().all()


def test_nothing_at_all_is_a_figure_that_says_so(paper: Any) -> None:
    drawing = paper.draw(_levels(PUBLISHED))
    bare = paper.draw(_rewards())
    axis = bare.figure.axes[0]
    assert axis.get_position().height * bare.figure.get_figheight() > 1.0
    assert len(axis.get_yticks()) == 0
    assert (drawing.shown, _bars(drawing)) == (0, [])
    assert words(drawing).count("not run") == 2 * CONDITIONS["one", "small"].task.levels
    assert collisions(drawing) == []


def test_missing_and_broken_trials_are_counted_at_the_bar(paper: Any) -> None:
    paper.put("one", "small", {0: 0.5, 1: 0.5, 2: (0.0, "diverged"), 3: math.nan})
    paper.put("other", "small", [(0.0, "diverged")] * 10)
    drawing = paper.draw(_rewards())
    assert [bar.get_height() for bar in _bars(drawing)] == [5.0]
    assert words(drawing).count("2/10") == 1
    assert "trial without a value" in told(drawing)
    crosses = [line for line in drawing.figure.axes[0].lines if line.get_marker() == "x"]
    assert [len(line.get_xdata()) for line in crosses] == [2, 10]
    assert "not run" not in words(drawing)
    assert "other on small: 10 of 10 trials diverged (no value; the worst rank in tests)." in drawing.missing


def test_published_numbers_stand_beside_ours_with_their_error_bars(paper: Any) -> None:
    paper.put("one", "small", [0.5] * 10)
    drawing = paper.draw(_levels(PUBLISHED))
    diamonds = [line for line in drawing.figure.axes[0].lines if line.get_marker() == "D"]
    assert [float(line.get_ydata()[0]) for line in diamonds] == [0.75, 0.25]
    rows = drawing.table[drawing.table["what"] == "reported"]
    assert list(zip(rows["at"], rows["value"], rows["error"], strict=True)) == [("0", 0.75, 0.125), ("1", 0.25, 0.0)]
    assert "reported by the paper" in told(drawing)
    assert "Reported: Fig. 9." in told(drawing)


def test_published_numbers_of_another_size_are_told_and_not_drawn(paper: Any) -> None:
    paper.put("one", "small", [0.5] * 10)
    drawing = paper.draw(_rewards(PUBLISHED, comparable=("elsewhere",)))
    assert not [line for line in drawing.figure.axes[0].lines if line.get_marker() == "D"]
    assert drawing.figure.axes[0].get_ylim()[1] < 10
    assert "Reported, on another scale: The One 4000 ± 20." in told(drawing)
    assert list(drawing.table[drawing.table["what"] == "reported"]["value"]) == [4000.0]


@pytest.mark.parametrize("values", [[0.0] * 10, [-3.0 + i for i in range(10)], [1e3] * 10])
def test_any_numbers_fit_the_axes(paper: Any, values: list[float]) -> None:
    paper.put("one", "small", values)
    paper.put("other", "small", [value + 100 for value in values])
    drawing = paper.draw(_rewards())
    low, high = drawing.figure.axes[0].get_ylim()
    assert low <= min(0.0, 10 * min(values))
    assert high > 10 * (max(values) + 100)
    assert collisions(drawing) == []


def test_the_same_trials_give_the_same_bytes_whatever_style_the_user_has_set(
    paper: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    paper.put("one", "small", [i / 10 for i in range(10)])
    paper.put("other", "small", [1 + i / 10 for i in range(8)])
    first = contents(paper.draw(_levels(PUBLISHED)))
    with mpl.rc_context({"font.size": 30, "svg.hashsalt": None, "axes.grid": True, "axes.facecolor": "black"}):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", "1")
        assert contents(paper.draw(_levels(PUBLISHED))) == first
        assert mpl.rcParams["font.size"] == 30


def test_hostile_text_is_text(paper: Any) -> None:
    nasty = "<script>alert('&')</script> $x_{$"
    paper.put("one", "small", [0.5] * 10)
    panel = compared(*REWARD[:2], (Series("one", nasty, "#0072b2"),), {"": "small"}, SILENT, title=nasty, ylabel=nasty)
    drawing = paper.draw(BarChart((panel,)))
    assert words(drawing).count(nasty) == 3
    assert b"<script>" not in contents(drawing)["svg"]
