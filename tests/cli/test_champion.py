"""`evoclaims champion`: what it prints, writes and returns."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny_project
from tiny_project import FILES, Evoclaims, Project, trials_of

from evoclaims.core.canonical import content_hash
from evoclaims.core.drawing import optional
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store

# What the command imports late: pytester forgets the modules that a test has imported, and would load them twice.
optional("evoclaims.cli.champion")

MORE = """
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Settings, Species

SMALL = Settings(population=8, nodes=8, connections=12, activations=("tanh", "sin"), species=Species(most=2))
METHODS |= {"neat": Neat(SMALL)}
REPRODUCTION = replace(REPRODUCTION, tiers={"smoke": Tier(conditions(3), Design.fixed(10))})
"""

OWN = Path(".evoclaims")
TRAINED = ("neat", "right")


@pytest.fixture(autouse=True)
def _evolving(project: Project) -> None:
    """The project has methods that evolve."""
    project.pytester.makepyfile(tiny_paper=tiny_project.REPRODUCTION + MORE)


@pytest.fixture
def trained(evoclaims: Evoclaims, kept: Path) -> Evoclaims:
    """A function that runs a command on one trial, of seed 4, of each method of TRAINED."""
    if not (kept / "store").exists():
        for method in TRAINED:
            assert evoclaims("run", method, "--trials=1", "--first-seed=4", "--device=cpu")[0] == 0
        shutil.copytree(".evoclaims", kept / "store")
    shutil.copytree(kept / "store", ".evoclaims", dirs_exist_ok=True)
    return evoclaims


@pytest.mark.parametrize("method", TRAINED)
def test_a_champion_is_replayed_and_equals_its_record(trained: Evoclaims, method: str) -> None:
    status, out, err = trained("champion", method, "--on=parity", "--seed=4", "--device=cpu")
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == f"{method} on parity (smoke)"
    assert lines[1].startswith("  seed 4: done after ")
    assert lines[2].split() == ["level", "success", "recorded", "fitness", "recorded"]
    level, success, recorded, fitness, as_recorded = lines[3].split()
    assert (level, success, fitness) == ("0", recorded, as_recorded)
    replayed, arrays = lines[4:]
    assert replayed == "The replay equals the stored record exactly."
    np.load(arrays.removeprefix("Its parameters, as numpy.load reads them: "), allow_pickle=False).close()


def _result(method: str) -> TrialResult:
    """Return the stored trial of a method."""
    (result,) = trials_of(Store(OWN), method)
    return result


def _change_record(result: TrialResult, **fields: Any) -> None:
    """Write other fields into a trial's record, sealed as one who knows how the seal is made."""
    (path,) = (path for path in Store(OWN).record_files(result.id) if path.exists())
    plain = {**json.loads(path.read_text()), **fields}
    plain["seal"] = content_hash({key: value for key, value in plain.items() if key != "seal"})
    path.write_text(json.dumps(plain))


def test_a_record_that_is_not_its_champions_gives_status_1_and_a_sentence(trained: Evoclaims) -> None:
    result = _result("neat")
    _change_record(result, levels={**result.levels, "success": [0.875]})
    arguments = ("champion", "neat", "--on=parity", "--seed=4", "--device=cpu")
    status, out, _ = trained(*arguments)
    assert status == 1
    assert re.search(r"^ +0 +[0-9.]+ +0.875 ", out, re.MULTILINE)
    assert "The replay differs from the stored record, which was made with the same versions" in out
    assert "equals" not in out
    _change_record(result, provenance={**result.provenance, "machine": "a mainframe"})
    status, out, _ = trained(*arguments)
    assert status == 1
    assert "made with other machine: rounding may differ there" in out


def test_a_changed_champion_is_told(trained: Evoclaims) -> None:
    path = Store(OWN).champion_file(_result("neat"))
    path.write_bytes(path.read_bytes() + b" ")
    status, _, err = trained("champion", "neat", "--on=parity", "--seed=4")
    assert (status, err.count("\n")) == (2, 1)
    assert "it is not the champion that the trial's record names" in err


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("naet", "--on=parity"), "There is no method named 'naet'. Did you mean 'neat'?"),
        (("neat", "--on=partiy"), "There is no task for neat named 'partiy'. Did you mean 'parity'?"),
        (("neat", "--on=parity", "--seed=-1"), "A seed is a whole number from 0 to 2147483647, not -1."),
        (
            ("neat", "--on=parity", "--seed=77"),
            "holds no trial of neat on parity (smoke) with seed 77, and no champion of it is committed. "
            "`evoclaims run neat --on parity --tier smoke --trials 1 --first-seed 77` runs it, in about ",
        ),
    ],
)
def test_a_users_mistake_is_one_sentence_and_status_2(
    trained: Evoclaims, arguments: tuple[str, ...], text: str
) -> None:
    status, _, err = trained("champion", *arguments)
    assert (status, err.count("\n")) == (2, 1)
    assert err.startswith("evoclaims: ")
    assert text in err
    assert {path.name for path in Path().iterdir()} <= FILES


def test_the_command_that_a_missing_trial_names_runs_it(evoclaims: Evoclaims) -> None:
    _, _, err = evoclaims("champion", "right", "--on=parity", "--seed=5")
    command = re.findall("`evoclaims (.*)`", err)[0].split()
    assert evoclaims(*command)[0] == 0
    assert evoclaims("champion", "right", "--on=parity", "--seed=5")[0] == 0
