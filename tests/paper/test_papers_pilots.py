"""The committed pilots of the paper under test are read, and are of the conditions that its smoke tier runs today."""

from __future__ import annotations

from pathlib import Path

import pytest

from evoclaims.paper import pilots
from reproductions.nisioti2025 import REPRODUCTION

SMOKE = REPRODUCTION.tier("smoke")
PILOTS = sorted(path for name in ("pilot", "second_pilot") for path in (REPRODUCTION.folder / name / "smoke").iterdir())


@pytest.mark.parametrize("path", PILOTS, ids=["-".join((path.parts[-3], path.stem)) for path in PILOTS])
def test_a_committed_pilot_has_fifty_other_seeds_of_todays_condition(path: Path) -> None:
    trials = pilots.load(path)
    method, _, task = path.stem.partition("-")
    condition = SMOKE.condition(method, task)
    design = SMOKE.design
    second = path.parts[-3] == "second_pilot"
    assert pilots.path_of(REPRODUCTION.folder, "smoke", method, task, second=second) == path
    assert {trial.condition for trial in trials} == {condition.id}
    assert {trial.seed for trial in trials} == {*range(150, 200)} if second else {*range(100, 150)}
    assert not {trial.seed for trial in trials} & {*design.seeds(design.last.n)}
