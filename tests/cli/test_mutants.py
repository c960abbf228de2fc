"""`evoclaims mutants`: planted faults, what claims notice of them, and the file that says so."""

from __future__ import annotations

import csv
import errno
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import unpacked
from tiny_project import BODIES, Evoclaims, Project, forget

from evoclaims.core import files
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import Tried
from evoclaims.verdicts.mutation_matrix import Fate, dump, load

BLIND = "parity: blind"
Sentence = Callable[[pytest.RunResult, str], None]


def test_a_claim_notices_a_blind_task_and_no_fault_in_what_never_learns(
    evoclaims: Evoclaims, stored: Store, project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    project.write(a="supported")
    status, out, err = evoclaims("mutants")
    assert (status, err) == (0, "")
    matrix = load(Path("mutants.toml"))
    right = matrix["smoke", "a"]
    assert BLIND in right.named(Fate.KILLED)
    assert right.methods == right.unnoticed == ("right",)
    assert "parity: wrong-row" in right.named(Fate.KILLED)
    assert "right: minimizes" in right.named(Fate.EQUIVALENT)
    assert right.tried is Tried.SENSITIVE
    lines = out.splitlines()
    first = lines.index("a (supported)")
    assert re.fullmatch(r"  \d+ killed by the verdict", lines[first + 1])
    assert lines[first + 2].startswith(f"    {BLIND}, paralysed")
    assert "    right: learns-nothing, minimizes, " in out
    assert max(map(len, lines[first:-2])) <= 80
    assert right.untried == ()
    assert "planted faults change a verdict" in out.splitlines()[-2]
    before = len(stored.ids())
    status, out, _ = evoclaims("mutants", "--mutant=blind")
    assert (status, out.splitlines()[-1]) == (0, f"{Path('mutants.toml').absolute()} is as it was")
    assert len(stored.ids()) == before
    assert load(Path("mutants.toml")) == matrix


def test_one_fault_of_one_target_whose_trials_cannot_be_stored_is_not_called_broken(
    evoclaims: Evoclaims, stored: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    sound = set(stored.ids())
    assert evoclaims("mutants", "--mutant=paralysed", "--of=parity")[0] == 0
    before = load(Path("mutants.toml"))
    (attempt,) = before["smoke", "a"].attempts
    assert (attempt.mutant, attempt.target) == ("paralysed", "parity")
    forget(stored, [trial for trial in stored.results([]) if trial.id not in sound])

    def read_only(path: Any, *arguments: Any, **more: Any) -> Any:
        if not isinstance(path, int) and stored.root.absolute() in Path(path).absolute().parents:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))
        return open(path, *arguments, **more)

    monkeypatch.setattr(files, "open", read_only, raising=False)
    status, _, err = evoclaims("mutants", "--mutant=paralysed")
    assert status == 1
    assert "Read-only file system" in err
    assert "2 of 4 conditions failed.\nevoclaims: 2 of them could not be tried, and mutants.toml keeps" in err
    assert load(Path("mutants.toml")) == before
    Path("mutants.toml").unlink()
    assert evoclaims("mutants", "--mutant=paralysed")[0] == 1
    assert not any(row.named(Fate.BROKEN) for row in load(Path("mutants.toml")).values())


def test_a_users_mistake_is_one_sentence(evoclaims: Evoclaims, stored: Store) -> None:
    for arguments, said in (
        (("--mutant=blnd",), "There is no mutant named 'blnd'. Did you mean 'blind'?"),
        (("--of=neat",), "There is no method or task named 'neat'."),
        (("--of=right", "--mutant=wrong-row"), "wrong-row is no fault of right. It can be planted in: parity."),
    ):
        status, _, err = evoclaims("mutants", *arguments)
        assert (status, err.count("\n")) == (2, 1)
        assert said in err


def _insensitive() -> None:
    """Write a matrix in which no fault changes the claim `a`, of whatever it is about now."""
    path = Path("mutants.toml")
    row = load(path)["smoke", "a"]
    survived = tuple(replace(one, part="method", fate=Fate.SURVIVED) for one in row.attempts)
    path.write_text(dump({("smoke", "a"): replace(row, attempts=survived, untried=())}))


def test_a_claim_that_notices_no_fault_is_called_insensitive_wherever_it_is_shown(
    evoclaims: Evoclaims, stored: Store, project: Project
) -> None:
    said = "claims against planted faults: not tried"
    assert said in evoclaims("status")[1]
    assert evoclaims("mutants", "--mutant=paralysed")[0] == 0
    assert said in evoclaims("status")[1]  # only one of those that apply
    _insensitive()
    counted = "1 supported but insensitive, 1 refuted"
    _, out, _ = evoclaims("status")
    assert f"claims against planted faults: 1 insensitive, 1 not tried\nclaims (smoke): {counted}\n" in out
    assert out.count("✓ supported, insensitive") == 1
    assert f"claims (smoke): {counted}" in evoclaims("report", "--tier=smoke")[1]
    assert "Insensitive. Planted faults: 0 of 1 change this verdict" in unpacked.read(Path("report/index.html"))
    heading, *rows = csv.reader(evoclaims("status", "--as=csv")[1].splitlines())
    assert [row[heading.index("faults")] for row in rows] == ["insensitive", "not tried"]
    run = project.run("-msmoke", own_store=True)
    run.stdout.fnmatch_lines(["claims against planted faults: 1 insensitive, 1 not tried", f"claims: {counted}"])
    project.write(a=BODIES["supported"].replace("in_most_trials()", "in_most_trials(p0=0.6)"), b="refuted")
    _, out, _ = evoclaims("status")
    assert "claims (smoke): 1 supported, 1 refuted" in out  # the matrix is about another claim than that of now
    assert said in out


def test_a_claim_that_has_lost_its_smoke_test_loses_its_row_and_its_accepted_verdict(
    accepted: Evoclaims, project: Project
) -> None:
    assert accepted("mutants", "--mutant=paralysed")[0] == 0
    assert {claim for _, claim in load(Path("mutants.toml"))} == {"a", "b"}
    body = BODIES["supported"]
    project.write(
        "@claim('a', says='a at full size', where='§1', smoke=None, because='it is small')\n"
        f"def test_a(trials, verdict):\n    {body}\n\n"
        f"@says('b')\ndef test_b(trials, verdict):\n    {BODIES['refuted']}\n"
    )
    assert accepted("mutants", "--stored", "--mutant=paralysed")[0] == 0
    assert {claim for _, claim in load(Path("mutants.toml"))} == {"b"}
    status, out, _ = accepted("accept", "--tier=smoke")
    assert (status, "retired: a (smoke), which was supported: it has no smoke test: it is small" in out) == (1, True)
    assert accepted("accept", "--tier=smoke")[0] == 0


def test_a_matrix_that_is_damaged_is_told_before_the_first_trial(project: Project, sentence: Sentence) -> None:
    project.write(a="supported")
    Path("mutants.toml").write_text("schema = 1\n[smoke.a")
    sentence(project.run("-msmoke"), "mutants.toml holds no matrix of mutants")


def test_stored_trials_alone_are_judged_if_asked_for(evoclaims: Evoclaims, project: Project) -> None:
    status, _, err = evoclaims("mutants", "--stored")
    assert (status, err.count("\n")) == (2, 1)
    assert "No claim of the smoke tier is judged yet" in err
    assert not Path("mutants.toml").exists()


def test_a_claim_that_a_fault_makes_an_error_is_told(evoclaims: Evoclaims, stored: Store, project: Project) -> None:
    """The matrix calls the fault broken, as where its trials crashed: nobody would look for an error in the claim."""
    project.write(
        a="right = trials('right', on='parity')\n"
        "    assert right.condition.task.name == 'n_parity', 'another task'\n"
        "    verdict(right.solves_every_level.in_most_trials())"
    )
    status, _, err = evoclaims("mutants", "--mutant=blind")
    assert (status, err.count("\n")) == (0, 1)
    assert err.startswith("evoclaims: parity: blind: a cannot be judged: AssertionError: another task")
    assert load(Path("mutants.toml"))["smoke", "a"].named(Fate.BROKEN) == (BLIND,)


def test_faulty_trials_of_other_versions_than_the_sound_ones_are_not_compared(
    evoclaims: Evoclaims, stored: Store
) -> None:
    """Sound trials may be committed ones of here where the store comes from another machine."""
    sound = set(stored.ids())
    assert evoclaims("mutants", "--mutant=blind")[0] == 0
    before = Path("mutants.toml").read_bytes()
    faulty = [trial for trial in stored.results([]) if trial.id not in sound]
    forget(stored, faulty)
    for trial in faulty:
        if trial.seed == 0:
            stored.put(trial, {})
            continue
        versions = {**trial.provenance["versions"], "jax": "0.4.1"}
        stored.put(replace(trial, provenance={**trial.provenance, "versions": versions}), {})
    status, _, err = evoclaims("mutants", "--stored", "--mutant=blind")
    assert (status, err.count("\n")) == (2, 1)
    assert re.search(
        r"with the fault 'blind' were made with other versions than those without it \(jax .* -> 0\.4\.1\)", err
    )
    assert Path("mutants.toml").read_bytes() == before
