"""A run beside the verdicts last accepted, and the page that GitHub shows of it."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tiny_project import REPRODUCTION, aged, forget, spoiled, trials_of

from evoclaims.claims.session import Session
from evoclaims.cli import main
from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.paper import references
from evoclaims.trials.store import Store
from evoclaims.verdicts import history

Sentence = Callable[[pytest.RunResult, str], None]
ALMOST = "verdict(trials('right', on='parity').solves_every_level.in_most_trials(p0=0.6))"


@pytest.fixture
def accepted(project: Any, kept: Path) -> Any:
    """The project with two claims whose verdicts are accepted."""
    project.write(a="supported", b="undecided")
    if not (kept / "verdicts.toml").exists():
        project.run()
        assert main(["accept", "--tier=smoke", f"--storage={project.store}"]) == 1
        shutil.copy("verdicts.toml", kept)
    shutil.copy(kept / "verdicts.toml", ".")
    return project


def _edit(**changes: Any) -> None:
    """Change the accepted verdict of `a`."""
    path = Path("verdicts.toml")
    kept = history.load(path)
    path.write_text(history.dump({**kept, ("smoke", "a"): (replace(kept["smoke", "a"][0], **changes),)}))


def test_verdicts_as_accepted_are_one_line(accepted: Any) -> None:
    result = accepted.run("--claims-compare-fail=*->*")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["against the accepted verdicts: 2 the same"])


@pytest.mark.parametrize(
    ("option", "status", "mark"),
    [
        ((), 0, ""),
        (("--claims-compare-fail=supported->refuted",), 0, ""),
        (("--claims-compare-fail=*->supported",), 1, "REGRESSION "),
    ],
)
def test_a_changed_verdict_is_listed_and_fails_the_run_where_it_is_asked_to(
    accepted: Any, option: tuple[str, ...], status: int, mark: str
) -> None:
    _edit(outcome=Outcome.REFUTED)
    result = accepted.run(*option)
    assert result.ret == status
    result.stdout.fnmatch_lines(
        ["against the accepted verdicts: 1 the same, 1 changed", f"{mark}a (smoke): refuted -> supported: *"]
    )
    assert result.outlines[-5:-1] == [
        "claims: 1 supported, 1 inconclusive",
        f"failed: {'a (smoke), regression' if mark else 'nothing'}",
        "changed: a (smoke)",
        "next: evoclaims compare   (every change), then evoclaims accept   (the current verdicts)",
    ]


@pytest.mark.parametrize(
    ("chance", "status", "said"),
    [
        (None, 1, "; how often this happens by chance is not known without pilots"),
        (0.01, 1, "; by chance this happens in 1.0% of draws from its pilots"),
        (0.011, 0, "; by chance this happens in 1.1% of draws from its pilots"),
    ],
)
def test_a_lost_support_fails_unless_chance_explains_it(
    accepted: Any, monkeypatch: pytest.MonkeyPatch, chance: float | None, status: int, said: str
) -> None:
    path = Path("verdicts.toml")
    kept = history.load(path)
    changed = {**kept, ("smoke", "b"): (replace(kept["smoke", "b"][0], outcome=Outcome.SUPPORTED),)}
    path.write_text(history.dump(changed))
    monkeypatch.setattr(Session, "_chance", lambda self, report, *_: chance if report.name == "b" else None)
    result = accepted.run("--claims-compare-fail=supported->refuted")
    assert result.ret == status
    assert said in result.stdout.str()
    assert "REGRESSION b (smoke): supported -> inconclusive" in result.stdout.str() or not status
    assert accepted.run().ret == 0


def test_a_changed_verdict_says_why_it_may_have_changed(accepted: Any) -> None:
    _edit(outcome=Outcome.REFUTED)
    said = " from the same trials to the bit, so that the code which judges or reads them has changed"
    accepted.run().stdout.fnmatch_lines([f"a (smoke): refuted -> supported:{said}"])
    _edit(trials="0" * 64, device="abacus", n=7)
    shown = accepted.run().stdout.str()
    draws = "its trials are other draws (device abacus -> cpu, n 7 -> 10); whether they drifted is"
    assert f"a (smoke): refuted -> supported: {draws} not known. With 10 trials a side" in shown


def test_what_other_trials_have_changed_is_not_said_to_be_from_the_same(accepted: Any, stored: Store) -> None:
    """The store has wrong trials of other versions; those of the accepted verdict are the reference trials."""
    right = trials_of(stored, "hand_built")
    references.write(references.path_of(Path("reference"), "smoke", "right", "parity"), right)
    forget(stored, right)
    for trial in right:
        stored.put(aged(spoiled(trial)), {})
    said = "the trials of right on parity (smoke) have drifted from the reference trials (see above)"
    for option in ("--claims-any-version", "--claims-stored"):
        shown = accepted.run(option, "--claims-only=a", own_store=True).stdout.str()
        assert f"a (smoke): supported -> refuted: {said}" in shown


def test_no_torn_file_of_reference_trials_that_a_run_does_not_need_hides_its_verdicts(
    accepted: Any, stored: Store
) -> None:
    _edit(outcome=Outcome.REFUTED)
    torn = references.path_of(Path("reference"), "full", "wrong", "parity")
    torn.parent.mkdir(parents=True)
    torn.write_text("torn\n")
    right = trials_of(stored, "hand_built")
    forget(stored, right)
    for trial in right:
        stored.put(aged(trial), {})
    result = accepted.run("--claims-any-version", "--claims-only=a", own_store=True)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["a (smoke): refuted -> supported: *", "changed: a (smoke)"])


def test_reasons_that_cannot_be_found_are_an_error_after_the_verdicts(
    accepted: Any, sentence: Sentence, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> str:
        raise UserError("The disk is gone.")

    _edit(outcome=Outcome.REFUTED)
    monkeypatch.setattr("evoclaims.verdicts.regression.reason", fail)
    result = accepted.run()
    assert result.ret == 1
    sentence(result, "error: The disk is gone.")
    result.stdout.fnmatch_lines(["a (smoke): refuted -> supported", "changed: a (smoke)"])


def test_an_accepted_claim_that_is_gone_is_listed_by_a_run_of_all_claims(accepted: Any) -> None:
    accepted.write(a="supported")
    gone = "b (smoke): gone; it was inconclusive"
    result = accepted.run()
    assert result.ret == 0
    result.stdout.fnmatch_lines(["against the accepted verdicts: 1 the same, 1 gone", gone, "changed: b (smoke), gone"])
    failing = accepted.run("--claims-compare-fail=*->*")
    assert failing.ret == 1
    failing.stdout.fnmatch_lines([f"REGRESSION {gone}", "failed: b (smoke), regression"])
    assert gone in accepted.run("-k", "test_a").outlines
    for others in ("claims/test_claims.py", "claims/test_claims.py::test_a"):  # which other files may have
        shown = accepted.run(others).outlines
        assert "against the accepted verdicts: 1 the same" in shown
        assert gone not in shown


def test_a_claim_that_is_judged_otherwise_begins_a_new_history(accepted: Any) -> None:
    accepted.write(a=ALMOST, b="undecided")
    _edit(outcome=Outcome.REFUTED)
    result = accepted.run("--claims-compare-fail=*->*")
    assert result.ret == 0
    result.stdout.fnmatch_lines(
        [
            "against the accepted verdicts: 1 the same, 1 under changed rules",
            "a (smoke): a new history begins, since what is judged has changed *: its trials are of the same "
            "conditions, but its assertion, *",
        ]
    )


def test_a_new_history_names_the_changed_setting(accepted: Any) -> None:
    sys.modules.pop("tiny_paper", None)
    edited = REPRODUCTION.replace('"right": HandBuilt()', '"right": HandBuilt(negated=True)')
    accepted.pytester.makepyfile(tiny_paper=edited)
    accepted.run().stdout.fnmatch_lines(
        ["a (smoke): a new history begins, *: of right on parity, method.name *, *.negated False -> True"]
    )


def test_a_new_history_takes_no_method_for_another_of_its_name(project: Any) -> None:
    two = REPRODUCTION.replace("    def init(", "    weight: float = 1.0\n\n    def init(", 1)
    two = two.replace('"coin": Coin()', '"coin": Coin(), "heavy": Coin(weight=2.0)')
    compared = "verdict(trials({!r}, on='parity').reward > trials({!r}, on='parity').reward)"
    project.write(a=compared.format("coin", "heavy"), b=compared.format("heavy", "coin"))
    project.pytester.makepyfile(tiny_paper=two)
    project.run(own_store=True)
    assert main(["accept", "--tier=smoke"]) == 1
    sys.modules.pop("tiny_paper", None)
    project.pytester.makepyfile(tiny_paper=two.replace('"smoke": Tier(conditions(1)', '"smoke": Tier(conditions(3)'))
    shown = project.run(own_store=True)
    for claim, methods in (("a", ("coin", "heavy")), ("b", ("heavy", "coin"))):
        longer = "; ".join(f"of {method} on parity, budget.generations 1 -> 3" for method in methods)
        shown.stdout.fnmatch_lines([f"{claim} (smoke): a new history begins, *: {longer}"])


def test_a_new_history_of_unknown_trials_has_fingerprints_alone(accepted: Any) -> None:
    accepted.write(a=ALMOST)
    _edit(outcome=Outcome.REFUTED, trials="0" * 64)
    accepted.run().stdout.fnmatch_lines(
        ["a (smoke): a new history begins, *: supported now, refuted under the old rules"]
    )


def test_a_gate_without_accepted_verdicts_does_not_stand_open(project: Any, sentence: Sentence) -> None:
    project.write(a="supported")
    result = project.run("--claims-compare-fail=supported->refuted")
    assert result.ret == 1
    sentence(result, "error: There are no accepted verdicts to compare with, since")
    result.stdout.fnmatch_lines(["claims: 1 supported"])


def test_accepted_verdicts_that_are_torn_fail_the_run_and_hide_no_verdict(accepted: Any, sentence: Sentence) -> None:
    Path("verdicts.toml").write_text("torn =")
    result = accepted.run()
    assert result.ret == 1
    sentence(result, "verdicts.toml holds no accepted verdicts: it is no whole TOML file")
    result.stdout.fnmatch_lines(["claims: 1 supported, 1 inconclusive", "failed: what the error above says"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("--claims-compare-fail=suported->refuted",),
            "There is no outcome named 'suported'. Did you mean 'supported'?",
        ),
        (("--claims-compare-fail=",), "No change of a verdict is named"),
        (("--claims-compare-fail=*->error", "--claims-variant=traded"), "Leave one of them out"),
    ],
)
def test_a_wrong_value_is_one_sentence_before_anything_runs(
    project: Any, sentence: Sentence, arguments: tuple[str, ...], said: str
) -> None:
    project.write(a="supported")
    result = project.run(*arguments, own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, said)
    assert not (project.path / ".evoclaims").exists()


def test_verdicts_of_a_variant_are_not_compared_with_those_of_the_protocol(accepted: Any) -> None:
    result = accepted.run("--claims-variant=traded")
    result.stdout.no_fnmatch_line("*accepted verdicts*")


def test_github_is_shown_the_verdicts_after_what_is_there_already(
    accepted: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = accepted.path / "page.md"
    page.write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(page))
    _edit(outcome=Outcome.REFUTED)
    accepted.run()
    lines = page.read_text().splitlines()
    assert lines[:4] == ["before", "## Claims", "", "**1 supported, 1 inconclusive**"]
    assert sum(line.startswith(("| a ", "| b ")) for line in lines) == 2
    assert any(line.startswith("* a (smoke): refuted -&gt; supported: ") for line in lines)
    assert any(line.startswith("* reference trials: ") for line in lines)


def test_a_page_that_cannot_be_written_is_a_warning_and_no_failure(
    project: Any, sentence: Sentence, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(project.path / "nowhere" / "page.md"))
    project.write(a="supported")
    result = project.run()
    assert result.ret == 0
    sentence(result, "warning: Cannot write the verdicts to GitHub's summary")
    result.stdout.fnmatch_lines(["claims: 1 supported"])


def test_commands_that_judge_stored_trials_add_nothing_to_the_page(
    accepted: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = accepted.path / "page.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(page))
    assert main(["status", f"--storage={accepted.store}"]) == 0
    assert not page.exists()
