"""Published numbers beside ours: which trials are compared with which number, under which variant."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_paper import CONDITIONS, Paper, made

from evoclaims.core.errors import UnknownNameError
from evoclaims.figures.replication import Replication, counts, replications
from evoclaims.judging.repetition import Agreement, Answer
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Variant

REPORTED = """
trials = 10

[plots.small.success]
place = "Fig. 1"
scale = [0, 1]
methods.one = { mean = [0.9, 0.5], error = [0.05, 0.05] }
methods.other.mean = [1]

[plots.small.last_success]
place = "Fig. 1"
scale = [0, 1]
methods.one = { mean = [0.5], error = [0.05] }

[plots.large.reward]
place = "Fig. 2"
methods.one = { mean = [9], error = [2] }
"""
HALVED = [0.45, 0.5, 0.55, 0.5, 0.45, 0.55, 0.5, 0.5, 0.5, 0.5]


@pytest.fixture
def reporting(paper: Paper) -> Paper:
    """The paper, with published numbers, and a variant in which `one` on the small task is trained for longer."""
    paper.reproduction.folder.mkdir()
    (paper.reproduction.folder / "reported.toml").write_text(REPORTED)
    plain = CONDITIONS["one", "small"]
    longer = replace(plain, budget=replace(plain.budget, generations=3))
    variant = Variant("longer", {"full": {("one", "small"): longer}})
    paper.reproduction = replace(paper.reproduction, variants={"longer": variant})
    return paper


def _found(paper: Paper, *variants: str) -> dict[tuple[str, str], Replication]:
    archive = Archive(paper.store, paper.reproduction.references)
    found = replications(archive, paper.reproduction, "full", variants or ("",))
    assert len({(one.name, one.variant) for one in found}) == len(found)
    return {(one.name, one.variant): one for one in found}


def test_every_published_number_is_read_once_from_the_trials_that_it_is_about(reporting: Paper) -> None:
    reporting.put("one", "small", HALVED)
    reporting.put("one", "large", [0.9] * 10)
    found = _found(reporting)
    assert [name for name, _ in found] == [
        "one on small: success at level 0",
        "one on small: success at level 1",
        "other on small: success at level 0",
        "one on large: episode reward",
    ]
    assert [one.level for one in found.values()] == [0, 1, 0, None]
    first, second, absent, reward = found.values()
    assert (first.numbers.mean, first.repetition.answer) == (pytest.approx(0.5), Answer.OUTSIDE)
    assert (second.numbers.mean, second.repetition.answer) == (pytest.approx(0.5), Answer.INSIDE)
    assert (absent.numbers.values, absent.repetition.answer, absent.repetition.reason) == (
        (),
        Answer.UNKNOWN,
        "not run",
    )
    assert (reward.numbers.mean, reward.reported.error, reward.repetition.answer) == (9.0, 2.0, Answer.INSIDE)


def test_equal_numbers_of_two_measures_are_two_numbers(reporting: Paper) -> None:
    path = reporting.reproduction.folder / "reported.toml"
    plots = (f'[plots.small.{name}]\nplace = "x"\nmethods.one.mean = [0.5]' for name in ("reward", "mean_success"))
    path.write_text(
        "\n".join(["trials = 10", *plots, '[plots.small.success]\nplace = "x"\nmethods.one.mean = [0.5, 1]'])
    )
    assert len(_found(reporting)) == 4


def test_a_variant_has_the_numbers_that_it_changes_and_has_run(reporting: Paper) -> None:
    reporting.put("one", "small", HALVED)
    reporting.put("one", "large", [0.9] * 10)
    assert [variant for _, variant in _found(reporting, "", "longer")] == [""] * 4
    longer = reporting.reproduction.tier("full", "longer").condition("one", "small")
    for seed in range(10):
        reporting.store.put(made(longer, seed, 0.9), {})
    found = _found(reporting, "", "longer")
    assert [name for name, variant in found if variant] == [f"one on small: success at level {k}" for k in range(2)]
    level = "one on small: success at level 0"
    assert (found[level, ""].repetition.answer, found[level, "longer"].repetition.answer) == (
        Answer.OUTSIDE,
        Answer.INSIDE,
    )
    longer = counts([*found.values()])["longer"]
    assert (longer[Agreement.CONTRADICTED], longer[Agreement.OPEN], sum(longer.values())) == (1, 0, 2)
    with pytest.raises(UnknownNameError, match="no variant named 'longr'"):
        _found(reporting, "longr")


def test_a_trial_without_a_number_leaves_the_answer_open(reporting: Paper) -> None:
    reporting.put("one", "small", [*HALVED[:9], (0.5, "diverged")])
    found = _found(reporting)["one on small: success at level 1", ""]
    assert found.repetition.reason == "1 of our 10 trials gave no number"


def test_what_the_tier_does_not_have_is_not_run(reporting: Paper) -> None:
    """A level too high, as of a smaller instance; a condition that no tier has."""
    path = reporting.reproduction.folder / "reported.toml"
    path.write_text('trials = 10\n[plots.small.success]\nplace = "x"\nmethods.one.mean = [0.5, 0.5, 0.5]\n')
    reporting.put("one", "small", HALVED)
    assert [one.repetition.reason for one in _found(reporting).values()][2] == "not run"
    path.write_text('trials = 10\n[plots.huge.success]\nplace = "x"\nmethods.one.mean = [0.5]\n')
    reporting.reproduction = replace(reporting.reproduction)  # which reads its numbers once
    assert [one.repetition.reason for one in _found(reporting).values()] == ["not run"]


def test_a_misspelled_measure_lists_the_known_ones(reporting: Paper) -> None:
    path = reporting.reproduction.folder / "reported.toml"
    path.write_text('trials = 10\n[plots.small.succes]\nplace = "x"\nmethods.one.mean = [0.5]\n')
    with pytest.raises(UnknownNameError, match="Did you mean 'success'"):
        _found(reporting)


def test_without_the_number_of_published_trials_nothing_can_be_said(reporting: Paper) -> None:
    path = reporting.reproduction.folder / "reported.toml"
    path.write_text(REPORTED.replace("trials = 10\n", ""))
    assert {one.repetition.answer for one in _found(reporting).values()} == {Answer.UNKNOWN}
