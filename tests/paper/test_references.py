"""Committed reference trials: read back as they were written, and a bad line named by file and number."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.drift import DriftCase
from evoclaims.paper import references
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult
from evoclaims.trials.result_codec import dump

Made = Callable[..., TrialResult]


@pytest.fixture
def path(reproduction: Reproduction) -> Path:
    """Where the reference trials of "better on small" belong."""
    return references.path_of(reproduction.references, "smoke", "better", "small")


@pytest.fixture
def trials(reproduction: Reproduction, made: Made) -> list[TrialResult]:
    """Four trials, in no order, one of them diverged."""
    condition = reproduction.tier("smoke").condition("better", "small")
    return [made(condition, seed, seed / 4, "diverged" if seed == 3 else "done") for seed in (2, 0, 3, 1)]


def test_what_is_written_is_read_in_the_order_of_seeds(
    path: Path, trials: list[TrialResult], reproduction: Reproduction
) -> None:
    assert path == reproduction.folder / "reference" / "smoke" / "better-small.jsonl"
    assert references.load(path) == ()
    references.write(path, trials)
    before = path.read_bytes()
    back = references.load(path)
    assert [trial.seed for trial in back] == [0, 1, 2, 3]
    assert [*map(dump, back)] == [*map(dump, sorted(trials, key=lambda t: t.seed))]
    assert len(before.splitlines()) == 4
    references.write(path, back)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "damage",
    [
        lambda line: line[: len(line) // 2],
        lambda line: line.replace(b'"seed":2', b'"seed":7'),
        lambda line: b"",
        lambda line: b"<<<<<<< HEAD",
    ],
    ids=["torn", "edited", "empty", "a merge conflict"],
)
def test_a_bad_line_is_named_by_file_and_number(
    path: Path, trials: list[TrialResult], damage: Callable[[bytes], bytes]
) -> None:
    references.write(path, trials)
    lines = path.read_bytes().splitlines()
    lines[2] = damage(lines[2])
    path.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(UserError, match="Line 3 of .*evoclaims reference") as caught:
        references.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


SAYS = {"device": {"platform": "cpu", "kind": "cpu"}, "machine": "Linux", "versions": {"jax": "1"}}


def test_a_trial_that_ran_out_of_time_is_not_compared_to_the_bit(made: Made, reproduction: Reproduction) -> None:
    condition = reproduction.tier("smoke").condition("better", "small")
    old, late = made(condition, 0, 1.0, **SAYS), made(condition, 0, 1.0, "timeout", **SAYS)
    for new, compared in ((old, 1), (late, 0)):
        _, check = references.compare([DriftCase("a", condition.id, (new,), (old,), ("mean_success",))])
        assert (check.compared, check.changed) == (compared, ())
