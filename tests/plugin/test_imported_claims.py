"""Claims about imported trials: judged as others are, beside trials that the harness runs, and by every command."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest
import unpacked
from tiny_project import Project

from evoclaims import cli
from evoclaims.cli.project import open_project
from evoclaims.figures.figure import Scope
from evoclaims.figures.trial_numbers import read
from evoclaims.trials.store import Store

PAPER = """
from pathlib import Path
import tiny_paper
from evoclaims import Design, Imported, Look, Reproduction, Tier

def imported(method, **settings):
    metric = {"mean_success": "success"}
    return Imported("runs.csv", seed="seed", metric=metric, where={"algo": method}, by="Ada", **settings)

CONDITIONS = {
    ("theirs", "parity"): imported("good"),
    ("worse", "parity"): imported("bad"),
    ("right", "parity"): tiny_paper.conditions(1)["right", "parity"],
}
DESIGNS = {"smoke": Design.fixed(10), "full": Design(looks=(Look(5, 0.01), Look(10, 0.04)))}
REPRODUCTION = Reproduction(
    "ours", "Ours", Path(__file__).parent, {name: Tier(CONDITIONS, design) for name, design in DESIGNS.items()}
)
"""

BETTER = "verdict(trials('theirs', on='parity').mean_success > trials('worse', on='parity').mean_success)"


def _table(good: list[str], bad: list[str]) -> str:
    rows = [f"{algo},{10 + 3 * k},{x}\n" for algo, found in (("good", good), ("bad", bad)) for k, x in enumerate(found)]
    return "algo,seed,success\n" + "".join(rows)


def _numbers(first: float, count: int = 10) -> list[str]:
    return [f"{first + k / 1000:.3f}" for k in range(count)]


@pytest.fixture
def ours(project: Project) -> Project:
    """A paper with two imported conditions and one that is run; `theirs` is better than `worse`."""
    (project.path / "pyproject.toml").write_text(
        (project.path / "pyproject.toml").read_text().replace("tiny_paper", "our_paper")
    )
    (project.path / "our_paper.py").write_text(PAPER)
    (project.path / "runs.csv").write_text(_table(_numbers(0.8), _numbers(0.3)))
    project.write(a=BETTER)
    return project


def _judged(project: Project, *arguments: str) -> tuple[str, str]:
    """Return the outcome of the claim and the reason."""
    (claim,) = project.json(*arguments)["claims"]
    return claim["outcome"], claim["reason"]


def test_imported_trials_are_judged_also_beside_those_that_the_harness_runs(ours: Project) -> None:
    assert _judged(ours) == ("supported", "p = 5.41e-06 <= alpha = 0.05 at n = 10")
    ours.write(a="verdict(trials('right', on='parity').mean_success > trials('theirs', on='parity').mean_success)")
    assert _judged(ours)[0] == "supported"
    ours.write(a="verdict(trials('theirs', on='parity').measure('mean_success', better='lower').between(0.7, 0.9))")
    assert _judged(ours)[0] == "supported"


@pytest.mark.parametrize("settings", ["metric={'mean_success': 'seed'}", "by='Bob'", "where={}, step='success'"])
def test_one_row_is_no_independent_trial_of_two_conditions(ours: Project, settings: str) -> None:
    paper = (ours.path / "our_paper.py").read_text()
    again = f"replace(imported('good'), {settings})"
    (ours.path / "our_paper.py").write_text(
        paper.replace("imported('bad')", again)
        .replace('imported("bad")', again)
        .replace("import tiny_paper", "import tiny_paper\nfrom dataclasses import replace")
    )
    outcome, reason = _judged(ours)
    assert outcome == "error"
    assert "read the same trials, which a rank test cannot compare" in reason


@pytest.mark.parametrize(
    ("curve", "outcome"),
    [
        ((1 / 3, 2 / 3, 1 / 7), "inconclusive"),
        ((0.25, 0.5, 2 / 3), "supported"),
        ((0.14, 0.28, 0.57), "supported"),  # times 10,000 they are no whole numbers, but for rounding
    ],
)
def test_one_curve_under_ten_seeds_counts_once_unless_it_may_be_chance(
    ours: Project, curve: tuple[float, ...], outcome: str
) -> None:
    rows = [
        f"{algo},{seed},{step},{value if algo == 'good' else seed / 1000}\n"
        for algo in ("good", "bad")
        for seed in range(10)
        for step, value in enumerate(curve)
    ]
    (ours.path / "runs.csv").write_text("algo,seed,at,success\n" + "".join(rows))
    paper = (ours.path / "our_paper.py").read_text()
    (ours.path / "our_paper.py").write_text(paper.replace('by="Ada"', 'by="Ada", step="at"'))
    found, reason = _judged(ours)
    assert found == outcome
    assert reason.startswith("all 10 trials of theirs on parity are copies of one") == (outcome == "inconclusive")


def test_a_new_history_names_the_edited_table(ours: Project) -> None:
    """Beside trials that the harness has run, whose specifications have other parts."""
    ours.write(a=BETTER, b="supported")
    ours.run(own_store=True)
    assert cli.main(["accept", "--tier=smoke"]) == 1  # something was written
    (ours.path / "runs.csv").write_text(_table(_numbers(0.9), _numbers(0.3)))
    del sys.modules["our_paper"]  # which has read the old one
    shown = ours.run(own_store=True).stdout.str()
    assert "a (smoke): a new history begins, " in shown
    assert "of theirs on parity, imported.sha256 " in shown
    assert "imported.where" not in shown  # rows of the same algorithm are compared


@pytest.mark.parametrize(
    ("tier", "count", "said"),
    [
        ("smoke", 9, "underpowered: needs n = 10 trials of theirs on parity, and there are 9"),
        ("full", 9, "underpowered: needs n = 10 trials of theirs on parity, and there are 9; the evidence: p = "),
    ],
)
def test_too_few_trials_are_inconclusive_and_say_how_many_it_needs(
    ours: Project, tier: str, count: int, said: str
) -> None:
    (ours.path / "runs.csv").write_text(_table(_numbers(0.3, count), _numbers(0.3)))
    outcome, reason = _judged(ours, f"-m{tier}")
    assert outcome == "inconclusive"
    assert reason.startswith(said)


def test_imported_trials_count_from_0_whatever_the_first_seed_of_the_design(
    ours: Project, capsys: pytest.CaptureFixture[str]
) -> None:
    """Beside trials that are run, which have the design's seeds."""
    paper = (ours.path / "our_paper.py").read_text()
    (ours.path / "our_paper.py").write_text(
        paper.replace("Design.fixed(10)", "Design((Look(10, 0.05),), first_seed=100)")
        .replace("import tiny_paper", "import tiny_paper\nfrom evoclaims import NullAgent")
        .replace(
            "Path(__file__).parent,",
            "Path(__file__).parent, null_agents={'right': NullAgent('x', method='right')}, tiers=",
        )
    )
    ours.write(a=BETTER, b="verdict(trials('right', on='parity').mean_success > 0.9)")
    assert "claims: 2 supported\n" in ours.run(own_store=True).stdout.str()
    opened = open_project(".evoclaims")
    scope = Scope(opened.archive, opened.reproduction, "smoke")
    drawn = {
        method: read(scope, method, "parity", lambda trials: trials.mean_success) for method in ("right", "theirs")
    }
    assert [number.seed for number in drawn["right"].each] == list(range(100, 110))
    assert [number.seed for number in drawn["theirs"].each] == list(range(10))
    assert all(len(of.values) == 10 for of in drawn.values())
    assert cli.main(["reference"]) == 0
    assert capsys.readouterr().out.count(": 10 trials") == 3
    cli.main(["audit", "--tier=smoke"])
    assert (
        "\n  right (too many trials are copies of each other): a\n" in capsys.readouterr().out
    )  # those of its own seeds
    assert cli.main(["accept", "--tier=smoke"]) == 1  # something was written
    (ours.path / "runs.csv").write_text(_table(_numbers(0.9), _numbers(0.3)))
    del sys.modules["our_paper"]  # which has read the old one
    edited = ours.run(own_store=True).stdout.str()
    assert "supported under the old rules: of theirs on parity, imported.sha256 " in edited


def test_plan_says_beforehand_that_a_table_is_too_short(ours: Project, capsys: pytest.CaptureFixture[str]) -> None:
    (ours.path / "runs.csv").write_text(_table(_numbers(0.3, 9), _numbers(0.3)))
    assert cli.main(["plan"]) == 0
    said = capsys.readouterr().out
    assert "theirs on parity: nothing to run: 9 trials are imported from runs.csv (algo good), sha256 " in said
    assert said.count(", and the design looks at 10") == 1


def test_no_other_trial_is_run_for_a_claim_that_lacks_imported_ones(ours: Project) -> None:
    (ours.path / "runs.csv").write_text(_table(_numbers(0.3, 4), _numbers(0.3)))
    ours.write(a="verdict(trials('right', on='parity').mean_success > trials('theirs', on='parity').mean_success)")
    result = ours.run("-m", "smoke", own_store=True)
    result.assert_outcomes(passed=0)
    assert Store(ours.path / ".evoclaims").ids() == ()


def test_diverged_trials_take_the_worst_rank(ours: Project) -> None:
    (ours.path / "runs.csv").write_text(_table(["nan"] * 10, _numbers(0.3)))
    assert _judged(ours)[0] == "refuted"
    said = " ".join(ours.run().stdout.str().split())
    assert "10 of 10 trials of theirs on parity diverged (seeds 0 (10 in the table), 1 (13 in the table), " in said


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (
            "verdict(trials('theirs', on='parity').measure('sucess').between(0, 1))",
            "There is no metric of theirs on parity named 'sucess'. Did you mean 'mean_success'? Known: mean_success.",
        ),
        (
            "verdict(trials('theirs', on='parity').last_success.between(0, 1))",
            "There is no 'last_success' in the finished trial of seed 0 (10 in the table)",
        ),
    ],
)
def test_a_measure_that_the_table_lacks_is_an_error_with_those_that_it_has(ours: Project, body: str, said: str) -> None:
    ours.write(a=body)
    outcome, reason = _judged(ours)
    assert outcome == "error"
    assert said in reason


@pytest.mark.parametrize(
    ("asserted", "said"),
    [
        (
            "event('e', lambda t: t.metrics['mean_success'] > 0.801).in_every_trial()",
            "seeds 0 (10 in the table), 1 (13 in",
        ),
        ("event('e', lambda t: 1).stays()", "in the trial of seed 0 (10 in the table), neither True nor"),
        (
            "measure('x', lambda t: float('nan')).between(0, 1)",
            "NaN in the finished trial of seed 0 (10 in the table) (id ",
        ),
    ],
)
def test_a_reason_names_a_trial_by_its_seed_in_the_table_too(ours: Project, asserted: str, said: str) -> None:
    ours.write(a=f"verdict(trials('theirs', on='parity').{asserted})")
    assert said in _judged(ours)[1]


def test_the_page_names_a_trial_by_its_seed_in_the_table_too(ours: Project) -> None:
    rows = [
        f"{algo},{seed},{step},{'nan' if seed == step == 12 else 0.01 * step + seed / 1000}\n"
        for algo in ("good", "bad")
        for seed in range(10, 20)
        for step in (11, 12)
    ]
    (ours.path / "runs.csv").write_text("algo,seed,at,success\n" + "".join(rows))
    paper = (ours.path / "our_paper.py").read_text()
    (ours.path / "our_paper.py").write_text(paper.replace('by="Ada"', 'by="Ada", step="at"'))
    assert cli.main(["report", "--tier=smoke"]) == 0
    page = unpacked.read(ours.path / "report" / "index.html")
    assert "2 of 20 trials diverged and count as the worst result (seeds 2 (12 in the table))." in page
    assert "seed 0 (10 in the table)" in page  # a line of the training curves


def test_a_missing_table_is_a_sentence(ours: Project, sentence: Callable[[pytest.RunResult, str], None]) -> None:
    (ours.path / "runs.csv").unlink()
    sentence(ours.run(), "runs.csv cannot be read: No such file or directory.")


def test_a_changed_table_is_compared_with_the_reference_trials_of_the_one_before(ours: Project) -> None:
    ours.run(own_store=True)
    assert cli.main(["reference"]) == 0
    ours.run(own_store=True).stdout.fnmatch_lines(["reference trials: 2 comparisons, 0 drifted*"])
    (ours.path / "runs.csv").write_text(_table(_numbers(0.6), _numbers(0.3)))
    sys.modules.pop("our_paper", None)  # which has read the table
    result = ours.run(own_store=True)
    result.stdout.fnmatch_lines(
        [
            "reference trials: 2 comparisons, 1 drifted*",
            "DRIFT in theirs on parity (smoke), another table: mean_success is lower now: median 0.8045 -> 0.6045*",
        ]
    )


def test_a_table_without_some_of_the_reference_trials_is_told_even_if_no_test_finds_a_drift(ours: Project) -> None:
    whole = _table(_numbers(0.8, 14), _numbers(0.3))

    def judged(table: str) -> str:
        (ours.path / "runs.csv").write_text(table)
        sys.modules.pop("our_paper", None)  # which has read the table
        return ours.run(own_store=True).stdout.str()

    judged(whole)
    assert cli.main(["reference"]) == 0
    edited = judged(whole.replace("good,10,0.800\n", "").replace("good,16,0.802\n", "").replace("0.804", "0.814"))
    assert "reference trials: 2 comparisons, 0 drifted" in edited
    assert (
        "EDITED theirs on parity (smoke), another table: reference trials that are judged no longer: seeds 10, 16 in "
        "the table; with other numbers: seeds 22 in the table\n"
    ) in edited
    assert "EDITED" not in judged(whole + "good,1000,0.1\n")


def test_commands_read_the_table_where_no_trial_is_stored_and_say_that_there_is_nothing_to_run(
    ours: Project, capsys: pytest.CaptureFixture[str]
) -> None:
    said = {}
    commands = ["status", "plan", "run theirs", "submit --dry-run --cluster=local", "champion theirs --on parity"]
    for command in [*commands, "run theirs --numprocesses=2", "mutants", "power", "report"]:
        cli.main(command.split())
        out, err = capsys.readouterr()
        said[command] = out + err
        assert "Traceback" not in said[command]
    count = "10 trials are imported from runs.csv (algo good), sha256 "
    assert "✓ supported  10  1.00" in said["status"]
    assert f"theirs on parity: nothing to run: {count}" in said["plan"]
    assert f"theirs on parity (smoke): nothing to run: {count}" in said["run theirs"]
    assert f"theirs on parity (smoke): nothing to run: {count}" in said["run theirs --numprocesses=2"]
    assert f"theirs on parity (smoke) has no champion: its {count}" in said["champion theirs --on parity"]
    assert "theirs on parity (its trials are imported, and there are no others)" in said["power"]
    assert "--run" not in said["power"]
    assert "No fault can be planted: the trials that the smoke tier's claims read are imported" in said["mutants"]
    report = unpacked.read(ours.path / "report" / "index.html")
    assert "imported from runs.csv, sha256 " in report
    assert "by Ada" in report
    assert '<th scope="row">0 (10 in the table)</th>' in report
    assert ">seed 0 (10 in the table): 0.8<" in report
