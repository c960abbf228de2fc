"""Claims change places among themselves in a run, other tests keep theirs, and one line tells how far the run is."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from evoclaims.claims.workload import Watching, Workload
from evoclaims.cli import main
from evoclaims.core.errors import UserError
from evoclaims.execution.ahead import Ahead, TierRun
from evoclaims.plugin.progress import ProgressLine

CLAIMS = """
@says('coin')
def test_coin(trials, verdict):
    verdict(trials('coin', on='parity').mean_success.greater(trials('wrong', on='parity').mean_success))

def test_plain():
    pass

@says('own')
def test_own(trials, verdict, tmp_path):
    verdict(trials('right', on='parity').solves_every_level.in_most_trials())

@says('wrong')
def test_wrong(trials, verdict):
    verdict(trials('wrong', on='parity').solves_no_level_beyond(-1).in_most_trials())

def test_last():
    pass

class TestRight:
    @says('right')
    @pytest.mark.parametrize('name', ['right'])
    def test_right(self, trials, verdict, name):
        assert not hasattr(self, 'seen'), 'an object of its own'
        self.seen = True
        verdict(trials(name, on='parity').solves_every_level.in_most_trials())
"""


def order(result: pytest.RunResult) -> list[str]:
    """Return the names of the tests in the order of their outcomes, from the output of -v."""
    lines = [line.split() for line in result.outlines if "::test_" in line and not line.startswith("FAILED")]
    names = [next(word for word in words if "::test_" in word) for words in lines]
    return [name.rpartition("::test_")[2].partition("[")[0] for name in dict.fromkeys(names)]


def test_claims_whose_trials_are_there_come_first_and_other_tests_keep_their_places(project: Any, stored: Any) -> None:
    """`coin` needs trials, so it is last; what `own` needs is not known, since it has a fixture of its own."""
    project.write(CLAIMS.replace(".greater(", ".__gt__("))
    result = project.run("-v", own_store=True)
    assert order(result) == ["wrong", "plain", "right", "own", "last", "coin"]
    result = project.run("-v", "-k", "not own", own_store=True)
    assert order(result) == ["coin", "plain", "wrong", "last", "right"]  # as written: all are stored by now


def test_an_option_that_asks_for_another_order_of_tests_has_it(project: Any, stored: Any) -> None:
    project.write(CLAIMS.replace(".greater(", ".__gt__("))
    for option in ("--failed-first", "--new-first", "--stepwise"):
        assert order(project.run("-v", option, own_store=True))[0] == "coin", option


def test_a_claim_that_stops_a_run_with_x_and_last_failed_are_what_they_are(project: Any, stored: Any) -> None:
    project.write(a="undecided", b="refuted", c="supported")
    result = project.run("-v", "-x", own_store=True)
    assert order(result) == ["b"]
    result = project.run("-v", "--lf", own_store=True)
    assert order(result) == ["b"]


@pytest.mark.parametrize(("gpus", "trials"), [((), 30), (("0", "1"), 10)])
def test_trials_for_the_drift_check_are_counted_where_they_are_made(
    project: Any, monkeypatch: pytest.MonkeyPatch, gpus: tuple[str, ...], trials: int
) -> None:
    """On GPUs they are not; nothing is run here."""
    project.write(a="supported")
    paper = project.path / "tiny_paper.py"
    more = 'Tier(conditions(1), Design.fixed(10), for_drift={("right", "parity"): 20})'
    paper.write_text(paper.read_text().replace("Tier(conditions(1), Design.fixed(10))", more))
    seen: list[int] = []

    def begin(line: ProgressLine, load: Workload, workers: int, tick: bool) -> None:
        seen.append(Watching(load, workers).look().trials)
        raise UserError("no more is needed")

    monkeypatch.setattr("evoclaims.execution.host.gpus", lambda device: gpus)
    monkeypatch.setattr("evoclaims.trials.devices.keep_off_gpus", lambda: None)
    monkeypatch.setattr(Ahead, "_run", lambda ahead, runs: None)
    monkeypatch.setattr(ProgressLine, "begin", begin)
    for processes in ("2", "auto") if gpus else ("1", "2"):
        project.run(f"--claims-processes={processes}", own_store=True)
    assert seen == [trials] * 2


@pytest.mark.parametrize(("smoke", "full"), [(20, 10), (10, 20)])
def test_a_condition_of_both_tiers_is_planned_once_with_the_trials_of_both(
    project: Any, monkeypatch: pytest.MonkeyPatch, smoke: int, full: int
) -> None:
    project.write(a="supported")
    paper = project.path / "tiny_paper.py"
    both = f'"smoke": Tier(conditions(1), Design.fixed({smoke})), "full": Tier(conditions(1), Design.fixed({full}))'
    paper.write_text(re.sub(r'"smoke": Tier.*Design.fixed\(10\)\)(?=})', both, paper.read_text()))
    planned: list[int] = []

    def note(ahead: Ahead, runs: Sequence[TierRun]) -> None:
        planned.extend(len(job.seeds) for run in runs for group in run.groups for job in group)

    def begin(*_: object, **__: object) -> None:
        raise UserError("no more is needed")

    monkeypatch.setattr(Ahead, "_run", note)
    monkeypatch.setattr(ProgressLine, "begin", begin)
    project.run("-m", "smoke or full", "--claims-processes=2", own_store=True)
    assert planned == [20]


def test_a_log_without_a_terminal_has_one_line_about_the_progress_and_none_when_quiet(project: Any) -> None:
    project.write(a="undecided", b="supported", c="refuted")
    shown = project.run(own_store=True).stdout.str()
    assert shown.count(" claims, ") == 1
    assert "  0/3 claims, 0/30 trials; coin on parity: compiling (10 trials)\n" in shown
    (project.path / ".evoclaims").rename(project.path / "gone")
    assert " claims, " not in project.run("-qq", own_store=True).stdout.str()


def test_processes_run_trials_ahead_and_the_line_tells_how_far_they_are(project: Any, stored: Any) -> None:
    project.write(CLAIMS.replace(".greater(", ".__gt__("))
    (project.path / "conftest.py").write_text(
        "import evoclaims.plugin.progress as progress\nprogress.TICK_SECONDS = 0.01\n"
    )
    result = project.run_apart("--claims-processes=2", "--claims-json=out.json", "-v")
    assert result.ret == 0
    plain = json.loads(Path("out.json").read_text())
    assert [claim["claim"] for claim in plain["claims"]] == ["coin", "own", "right", "wrong"]
    assert order(result) == ["wrong", "plain", "right", "own", "last", "coin"]
    (line,) = [line for line in result.outlines if " claims, " in line]
    assert re.match(r"  [0-3]/4 claims, 20/30 trials; coin on parity: ", line)


def test_a_run_that_takes_processors_hours_is_told_of_beforehand(project: Any, stored: Any) -> None:
    """The right network solves every level at once, but its budget is long at the pace of the reference trials."""
    project.write(right="supported")
    assert main(["reference", "--unknown-revision", "--storage", str(stored.root)]) == 0
    sys.modules.pop("tiny_paper")  # as this process has read it; monkeypatch would put it back for other tests
    paper = project.path / "tiny_paper.py"
    paper.write_text(paper.read_text().replace("Tier(conditions(2)", "Tier(conditions(10**9)"))
    told = "The missing trials take up to "
    refused = project.run("--claims-only=other", "--claims-device=cpu", own_store=True)
    assert told not in str(refused.stdout)  # nor does anything run
    result = project.run("-m", "full", "--claims-device=cpu", own_store=True)
    (line,) = [line for line in result.outlines if told in line]
    hours = re.search(r"up to ([\d,]+) hours of a processor's core\. `evoclaims plan` of this tier says", line)
    assert hours
    assert int(hours[1].replace(",", "")) > 1  # how many is a matter of the machine
    again = project.run("-m", "full", "--claims-device=cpu", own_store=True)
    assert told not in str(again.stdout)  # they are stored by now
