"""The committed pilots of the paper under test are read, and are of the conditions that its smoke tier runs today."""

from __future__ import annotations

from pathlib import Path

import pytest

from evoclaims.paper import pilots
from reproductions.nisioti2025 import REPRODUCTION

SMOKE = REPRODUCTION.tier("smoke")
PILOTS = sorted((REPRODUCTION.folder / "pilot" / "smoke").iterdir())


@pytest.mark.parametrize("path", PILOTS, ids=[path.stem for path in PILOTS])
def test_a_committed_pilot_has_fifty_other_seeds_of_todays_condition(path: Path) -> None:
    trials = pilots.load(path)
    method, _, task = path.stem.partition("-")
    condition = SMOKE.condition(method, task)
    design = SMOKE.design
    assert pilots.path_of(REPRODUCTION.folder, "smoke", method, task) == path
    assert {trial.condition for trial in trials} == {condition.id}
    assert len({trial.seed for trial in trials} - set(design.seeds(design.last.n))) == 50
