"""Published numbers: read with their places, or refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.paper.reported import SENTENCES_FILE, Reported, Uncovered, load_published, uncovered

SOUND = """
[plots.maze.reward]
place = "Fig. 5"
methods.neat = { mean = [5, 6.5], error = [1, 0.5] }
methods.ppo.mean = [1]

[tables.neat]
place = "Table 1"
values = { "population size" = 5000 }
"""


def _write(folder: Path, text: str) -> Path:
    path = folder / "reported.toml"
    path.write_text(text)
    return path


def test_a_number_has_its_error_bar_and_its_place(tmp_path: Path) -> None:
    published = load_published(_write(tmp_path, SOUND))
    assert published.value("maze", "reward", "neat", 1) == Reported(6.5, 0.5, "Fig. 5")
    assert published.value("maze", "reward", "ppo") == Reported(1.0, None, "Fig. 5")
    assert published.table("neat") == {"place": "Table 1", "values": {"population size": 5000}}


def test_a_number_knows_its_trials_and_its_scale_where_the_file_says_them(tmp_path: Path) -> None:
    text = "trials = 10\n" + SOUND.replace('"Fig. 5"', '"Fig. 5"\nscale = [0, 7]\nprecision = 0.5')
    found = load_published(_write(tmp_path, text)).value("maze", "reward", "neat", 1)
    assert found == Reported(6.5, 0.5, "Fig. 5", trials=10, scale=(0.0, 7.0), precision=0.5)


def test_what_is_not_published_is_nothing(tmp_path: Path) -> None:
    published = load_published(_write(tmp_path, SOUND))
    for task, quantity, method, at in (
        ("maze", "reward", "neat", 2),
        ("maze", "reward", "cma_es", 0),
        ("maze", "stones", "neat", 0),
        ("gate", "reward", "neat", 0),
    ):
        assert published.value(task, quantity, method, at) is None
    with pytest.raises(UnknownNameError, match="no published table named 'ppo'. Known: neat"):
        published.table("ppo")


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[plots.maze.reward]\nmethods.neat.mean = [1]\n", "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat = { mean = [1, 2], error = [1] }\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat.error = [1]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nscale = [0, 1]\nmethods.neat.mean = [2]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nscale = [0]\nmethods.neat.mean = [0]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat.mean = 0.5\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat.mean = ["high"]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat = { mean = [1], error = 0.5 }\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat = [1]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods = ["neat"]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nscale = ["a", "b"]\nmethods.neat.mean = [1]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nprecision = "half"\nmethods.neat.mean = [1]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nprecision = -1\nmethods.neat.mean = [1]\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat = { mean = [1], error = [-1] }\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat = { mean = [1], error = [nan] }\n', "maze.reward"),
        ('[plots.maze.reward]\nplace = "Fig. 5"\nmethods.neat.mean = [inf]\n', "maze.reward"),
        ("[plots.maze]\nreward = 3\n", "maze.reward"),
        ("[plots]\nmaze = 3\n", "maze"),
        ("plots = 3\n", "plots"),
        ("tables = 3\n", "tables"),
        ("[tables]\nneat = 3\n", "neat"),
        ("trials = 1\n", "trials"),
        ('trials = "ten"\n', "trials"),
        ("[tables.neat]\nvalues = { a = 1 }\n", "neat"),
        ('[tabels.neat]\nplace = "x"\nvalues = { a = 1 }\n', "tabels"),
    ],
)
def test_a_number_without_its_place_or_a_torn_plot_is_refused(tmp_path: Path, text: str, what: str) -> None:
    with pytest.raises(UserError, match=f"entries that are not as expected: {what}"):
        load_published(_write(tmp_path, text))


ONE = '[[sentence]]\nline = {}\nsays = "a"\nbecause = "b"\n'


def test_sentences_without_a_claim_are_read_in_the_papers_order(tmp_path: Path) -> None:
    assert uncovered(tmp_path) == ()
    (tmp_path / SENTENCES_FILE).write_text(ONE.format(9) + ONE.format(3))
    assert uncovered(tmp_path) == (Uncovered(3, "a", "b"), Uncovered(9, "a", "b"))


@pytest.mark.parametrize("text", ["[[sentence", "[[sentence]]\nline = 3\n", ONE.format('"x"'), "sentence = 3\n"])
def test_a_file_that_holds_no_sentences_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / SENTENCES_FILE).write_text(text)
    with pytest.raises(UserError, match=r"Cannot read .*sentences.toml: .* with line \(a number\), says and because"):
        uncovered(tmp_path)
