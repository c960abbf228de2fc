"""`evoclaims mutants --numprocesses N`: what one process dies of costs no other condition, and stored trials stay."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_project import REPRODUCTION, Evoclaims, Project

from evoclaims.cli.worker import Order
from evoclaims.cli.workers import Workers, bundled, processes_of
from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.mutants.conditions import Job, sharing_programs
from evoclaims.trials.budget import Budget
from evoclaims.trials.spec import Condition
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
    assert "right on parity, right: dies failed: its process died (status 7)." in err
    assert "1 of 2 conditions failed." in err
    assert load(Path("mutants.toml"))["smoke", "a"].named(Fate.BROKEN) == ("right: dies",)
    assert evoclaims("mutants", "--mutant=negated", "--numprocesses=2")[0] == 0
    rows = load(Path("mutants.toml"))
    assert rows["smoke", "a"].named(Fate.KILLED) == ("right: negated",)
    assert rows["smoke", "a"].named(Fate.BROKEN) == ("right: dies",)
    assert rows["smoke", "b"].named(Fate.KILLED) == ("wrong: negated",)
    assert stored.ids() == before  # the opposite of the right network is the wrong one, which has run already


@pytest.mark.usefixtures("stored")
def test_several_processes_write_what_one_writes(evoclaims: Evoclaims) -> None:
    assert evoclaims("mutants", "--mutant=blind", "--numprocesses=2")[0] == 0
    in_processes = Path("mutants.toml").read_text()
    Path("mutants.toml").unlink()
    status, out, _ = evoclaims("mutants", "--mutant=blind", "--stored")
    assert (status, Path("mutants.toml").read_text()) == (0, in_processes)
    assert "conditions have ended" not in out


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


def test_a_group_goes_on_behind_the_condition_that_its_process_died_of(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    group = [Job("", "neat", str(number)) for number in range(4)]
    stored: set[Job] = set()
    orders = []

    def process(self: Workers, left: Sequence[Job]) -> tuple[int, str]:
        """Run all but the condition that kills."""
        orders.append(list(left))
        for one in left:
            if one.task == "1":
                return -11, ""
            stored.add(one)
        return 0, ""

    monkeypatch.setattr(Workers, "_process", process)
    Workers(Order("", "smoke", "cpu", ()), 1, lambda one: one not in stored).run([(group, 4.0)])
    assert orders == [group, group[2:]]
    assert stored == {group[0], *group[2:]}
    out, err = capsys.readouterr()
    assert "neat on 1 failed: its process died (status -11)." in err
    assert "4 of 4 conditions have ended, 0 s left" in out


@given(st.lists(st.tuples(st.integers(1, 3), st.floats(0.1, 100)), max_size=30), st.integers(1, 5))
def test_bundles_hold_whole_groups_once_and_end_at_about_the_same_time(
    sizes: list[tuple[int, float]], processes: int
) -> None:
    groups = [([Job("", f"{i}", f"{k}") for k in range(size)], took) for i, (size, took) in enumerate(sizes)]
    bundles = [(tuple(bundle), took) for bundle, took in bundled(groups, processes)]
    total, longest = sum(took for _, took in groups), max((took for _, took in groups), default=0.0)
    assert sum(len(bundle) for bundle, _ in bundles) == sum(len(group) for group, _ in groups)
    assert sum(took for _, took in bundles) == pytest.approx(total)
    assert all(took <= longest + total / (8 * processes) for _, took in bundles)
    for group, _ in groups:
        (bundle,) = (bundle for bundle, _ in bundles if group[0] in bundle)
        at = bundle.index(group[0])
        assert bundle[at : at + len(group)] == tuple(group)


def test_a_number_of_processes_is_one_or_more() -> None:
    assert processes_of("3") == 3
    assert processes_of("auto") >= 1
    for text in ("0", "-1", "many", ""):
        with pytest.raises(UserError, match="--numprocesses takes a number from 1 up, or auto"):
            processes_of(text)
