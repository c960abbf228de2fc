"""`evoclaims plan`: what is stored and missing, which claims cannot be judged, and what trials have taken."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_project import Evoclaims, Project

from evoclaims.paper import references
from evoclaims.trials.store import Store


def test_plan_counts_what_is_stored_and_what_is_missing(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("plan")
    assert status == 0
    assert re.search(r"^right on parity +0 +10 +40 +unknown$", out, re.MULTILINE)
    assert re.search(r"^total +80 +unknown$", out, re.MULTILINE)
    assert "Times are by" not in out
    assert re.search(r"^a +10 +0.05 +0.028 +\S+ +✓✗$", out, re.MULTILINE)
    assert "--measure times a few steps" in out
    assert "coin" not in out  # no claim asks for it
    evoclaims("run", "right", "--trials", "4")
    status, out, _ = evoclaims("plan")
    assert re.search(r"^right on parity +4 +6 +24 +\d+ s$", out, re.MULTILINE)
    assert re.search(r"^wrong on parity +0 +10 +40 +unknown$", out, re.MULTILINE)


def test_plan_counts_the_trials_of_a_third_look_where_a_claim_is_open(evoclaims: Evoclaims, project: Project) -> None:
    paper = project.path / "tiny_paper.py"
    looks = "Design(looks=(Look(5, 0.01), Look(10, 0.04)))"
    text = paper.read_text().replace("Design.fixed(10)", looks)
    paper.write_text(text.replace("import Design", "import Design, Look"))
    body = (
        "def test_{0}(trials, verdict):\n    verdict(trials('{0}', on='parity').solves_every_level.in_most_trials())\n"
    )
    third = "@third_look\n@says('{0}')\n" + body
    under = third.replace("@third_look", "@third_look('traded')")  # a variant, not the protocol of the text
    project.write(
        "from evoclaims import third_look\n"
        + "\n\n".join([third.format("right"), third.format("coin"), under.format("wrong")])
    )
    status, out, err = evoclaims("plan")
    assert (status, err) == (0, "")
    assert re.search(r"^right on parity +0 +30 +120 +unknown$", out, re.MULTILINE), out
    assert re.search(r"^coin on parity +0 +30 +120 +unknown$", out, re.MULTILINE)
    assert re.search(r"^wrong on parity +0 +10 +40 +unknown$", out, re.MULTILINE)
    assert re.search(r"^total +280 +unknown$", out, re.MULTILINE)
    rest = "Trials beyond 10 of a condition run only where a claim with a third look is open after them: "
    assert f"{rest}coin on parity, right on parity." in " ".join(out.split())
    evoclaims("run", "right")
    status, out, _ = evoclaims("plan")  # ten of ten decide the claim, so that no third look follows
    assert re.search(r"^right on parity +10 +0 +0 +0 s$", out, re.MULTILINE), out
    assert f"{rest}coin on parity." in " ".join(out.split())


def test_plan_counts_trials_for_the_drift_check_on_cpus(evoclaims: Evoclaims, project: Project) -> None:
    paper = project.path / "tiny_paper.py"
    more = 'Tier(conditions(1), Design.fixed(10), for_drift={("right", "parity"): 20})'
    paper.write_text(paper.read_text().replace("Tier(conditions(1), Design.fixed(10))", more))
    assert evoclaims("run", "right")[0] == 0
    assert evoclaims("reference", "--unknown-revision")[0] == 0
    path = Path("reference/smoke/right-parity.jsonl")
    device = {"platform": "gpu", "kind": "NVIDIA Abacus", "count": 1}
    references.write(path, [replace(t, provenance={"device": device}) for t in references.load(path)])
    assert re.search(r"^right on parity +10 +20 +80 ", evoclaims("plan")[1], re.MULTILINE)
    assert re.search(r"^right on parity +10 +0 +0 ", evoclaims("plan", "--like=NVIDIA Abacus")[1], re.MULTILINE)


def test_plan_says_which_claim_cannot_be_judged_and_why(evoclaims: Evoclaims, project: Project) -> None:
    project.write(c="verdict(trials('rigth', on='parity').mean_success > 0)")
    status, out, _ = evoclaims("plan")
    assert status == 0
    assert "c: error: There is no method named 'rigth'. Did you mean 'right'?" in " ".join(out.split())


def test_plan_shows_whole_numbers_on_a_narrow_terminal(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "52")
    _, out, _ = evoclaims("plan")
    assert re.search(r"^right on +0 +10 +40 +unknown *\nparity *$", out, re.MULTILINE), out
    assert re.search(r"^a +10 +0.05 +0.028 +\S+ +✓✗$", out, re.MULTILINE), out
    monkeypatch.setenv("COLUMNS", "30")  # too narrow for the numbers alone: lines are longer, and nothing is cut
    _, out, _ = evoclaims("plan")
    assert re.search(r"^right on parity +0 +10 +40 +unknown$", out, re.MULTILINE), out
    assert re.search(r"^a +10 +0.05 +0.028 +\S+ +✓✗$", out, re.MULTILINE), out
    monkeypatch.setenv("COLUMNS", "0")  # a terminal that knows no size
    _, out, _ = evoclaims("plan")
    assert re.search(r"^right on parity +0 +10 +40 +unknown$", out, re.MULTILINE), out


def test_plan_tells_times_as_of_a_device_that_trials_were_made_on(evoclaims: Evoclaims) -> None:
    evoclaims("run", "right", "--trials", "4")
    status, out, _ = evoclaims("plan", "--like", "cpu")
    assert status == 0
    assert "as they took on one cpu" in out
    assert re.search(r"^right on parity +4 +6 +24 +\d+ s$", out, re.MULTILINE)
    status, _, err = evoclaims("plan", "--like", "abacus")
    assert status == 2
    assert "No trial of the smoke tier at hand was made on a device called 'abacus'" in err


def test_plan_of_a_variant_has_what_it_changes_and_the_claims_that_read_it(
    evoclaims: Evoclaims, project: Project, stored: Store
) -> None:
    """The variant's right network is the protocol's wrong one, whose trials are stored."""
    assert evoclaims("reference", "--unknown-revision")[0] == 0
    status, out, _ = evoclaims("plan", "--variant", "traded")
    assert status == 0
    assert "Conditions of the smoke tier that traded changes, on " in out
    assert re.search(r"^right on parity +10 +0 +0 +0 s$", out, re.MULTILINE)
    assert "wrong on parity" not in out
    assert re.search(r"^a +10 +0.05 ", out, re.MULTILINE)
    assert not re.search(r"^b ", out, re.MULTILINE)
    project.write(b="refuted")
    status, _, err = evoclaims("plan", "--variant", "traded")
    assert status == 2
    assert err == "evoclaims: The variant traded changes no condition that claims of the smoke tier read.\n"


def test_plan_tells_what_the_reference_trials_have_cost(evoclaims: Evoclaims, stored: Store) -> None:
    assert "reference trials" not in evoclaims("plan")[1]
    assert evoclaims("reference", "--unknown-revision")[0] == 0
    path = Path("reference/smoke/right-parity.jsonl")
    device = {"platform": "gpu", "kind": "NVIDIA Abacus", "count": 1}
    timing = {"run": 7000.0, "compile": 200.0, "batch": 10, "started": "2026-01-01T00:00:00+00:00"}
    references.write(path, [replace(t, provenance={"device": device}, timing=timing) for t in references.load(path)])
    made_here = Path("reference/smoke/wrong-parity.jsonl").rename("wrong-parity.jsonl")
    out = evoclaims("plan")[1]
    assert re.search(r"took on one *\n.*NVIDIA Abacus$", out, re.MULTILINE)
    assert re.search(r"^right on parity +10 +0 +0 +0 s$", out, re.MULTILINE)
    assert re.search(r"^right on parity +2 h 00 min$", out, re.MULTILINE)
    assert re.search(r"^wrong on parity +not run$", out, re.MULTILINE)
    assert re.search(r"^total +2 h 00 min *\n +and more$", out, re.MULTILINE)
    assert "Fewer than 10 reference trials: wrong on parity (0)." in out
    assert re.search(r"^a +10 +.*✓✗ +2 h 00 min$", out, re.MULTILINE)
    assert re.search(r"^b +10 +.*✓✗ +not run$", out, re.MULTILINE)
    made_here.rename("reference/smoke/wrong-parity.jsonl")
    out = evoclaims("plan")[1]
    assert re.search(r"^wrong on parity +–$", out, re.MULTILINE)
    assert re.search(r"^total +2 h 00 min *\n +\+ elsewhere", out, re.MULTILINE)


def test_plan_takes_the_pace_of_other_tiers_where_a_condition_has_not_run(evoclaims: Evoclaims, stored: Store) -> None:
    assert evoclaims("reference", "--unknown-revision")[0] == 0
    out = evoclaims("plan", "--tier", "full")[1]
    assert "took on one" not in out
    assert re.search(r"^right on parity +0 +10 +80 +\d+ s$", out, re.MULTILINE)
