"""`evoclaims mutants --numprocesses N`: what one process dies of costs no other condition, and stored trials stay."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_project import REPRODUCTION, Evoclaims, Project

from evoclaims.envs.gates.parity import NParity
from evoclaims.execution.job import Job, sharing_programs
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store
from evoclaims.verdicts.mutation_matrix import Fate, load

OWN = """
import os
from dataclasses import replace

from evoclaims.mutants import Fault, plant, with_method


class Dies(Fault):
    says = "dies"

    def init(self, key, task):
        os._exit(7)


MUTANTS = {
    "dies": with_method("dies", lambda method: plant(Dies, method) if not method.negated else method),
    "negated": with_method("answers the opposite", lambda method: replace(method, negated=not method.negated)),
}
"""


@pytest.fixture
def own(project: Project) -> None:
    """The tiny paper, with mutants of its own."""
    paper = REPRODUCTION.replace('name="tiny",', 'name="tiny", mutants="tiny_mutants",')
    project.pytester.makepyfile(tiny_paper=paper, tiny_mutants=OWN)


@pytest.mark.usefixtures("own")
def test_a_process_that_dies_loses_its_condition_alone_and_the_next_call_runs_that_alone(
    evoclaims: Evoclaims, stored: Store
) -> None:
    before = stored.ids()
    status, _, err = evoclaims("mutants", "--mutant=dies", "--numprocesses=2")
    assert status == 1
    assert "right on parity, right: dies (smoke) failed: its process died (status 7), 3 times." in err
    assert "1 of 2 conditions failed." in err
    assert load(Path("mutants.toml"))["smoke", "a"].named(Fate.BROKEN) == ("right: dies",)
    assert evoclaims("mutants", "--mutant=negated", "--numprocesses=2")[0] == 0
    rows = load(Path("mutants.toml"))
    assert rows["smoke", "a"].named(Fate.KILLED) == ("right: negated",)
    assert rows["smoke", "a"].named(Fate.BROKEN) == ("right: dies",)
    assert rows["smoke", "b"].named(Fate.KILLED) == ("wrong: negated",)
    status, out, _ = evoclaims("mutants", "--mutant=negated", "--stored")
    assert (status, load(Path("mutants.toml")), "conditions have ended" in out) == (0, rows, False)
    assert stored.ids() == before  # the opposite of the right network is the wrong one, which has run already


CONDITION = Condition(HandBuilt(), NParity(2), "curriculum", Budget(generations=1))
SOUND = {
    ("a", "small"): CONDITION,
    ("a", "alike"): CONDITION,
    ("a", "large"): replace(CONDITION, task=NParity(3)),
    ("b", "small"): replace(CONDITION, method=HandBuilt(negated=True)),
}


def test_conditions_of_one_fault_that_may_share_programs_are_one_group() -> None:
    asked = [
        *(Job("", *names) for names in SOUND),
        *(Job("a: minimizes", *names) for names in SOUND if names[0] == "a"),
        *(Job(f"{task}: blind", "a", task) for task in ("small", "alike", "large")),
    ]
    groups = sharing_programs(asked, SOUND)
    assert Counter(one for group in groups for one in group) == Counter(asked)
    assert [[(one.fault, one.task) for one in group] for group in groups if len(group) > 1] == [
        [("", "small"), ("", "alike")],
        [("a: minimizes", "small"), ("a: minimizes", "alike")],
        [("small: blind", "small"), ("alike: blind", "alike")],
    ]
