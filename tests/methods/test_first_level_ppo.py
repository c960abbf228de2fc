"""PPO whose environments never leave the first level, as in the published code."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from workbench import Workbench

from evoclaims.envs import NParity
from evoclaims.methods import Ppo
from reproductions.nisioti2025 import REPRODUCTION
from reproductions.nisioti2025.first_level_ppo import FirstLevelPpo

pytestmark = pytest.mark.newest

SETTINGS: dict[str, Any] = {
    "policy_layers": (3,),
    "value_layers": (3,),
    "environments": 16,
    "batch_size": 16,
    "minibatches": 1,
    "updates_per_batch": 1,
}
LEARNER = FirstLevelPpo(**SETTINGS)


def test_at_a_later_level_it_trains_on_rows_of_the_first_and_is_tested_on_the_laters() -> None:
    """In the first level of 3-parity the first bit is 0."""
    task = NParity(3, "sampled")
    bench, usual = Workbench(LEARNER, task), Workbench(Ppo(**SETTINGS), task)
    state, (*_, told) = bench.run(3, level=1)
    assert int(state.interaction.level) == 0
    assert not np.asarray(state.interaction.states.observation)[:, 0].any()
    assert np.asarray(usual.run(3, level=1)[0].interaction.states.observation)[:, 0].any()
    assert float(told.success) == float(bench.examine(state, level=1).success)
    assert float(told.success) != float(bench.examine(state, level=0).success)


def test_only_ppo_with_a_curriculum_is_changed_and_keeps_its_settings() -> None:
    conditions = REPRODUCTION.variants["first_level"].conditions["full"]
    assert set(conditions) == {("ppo", "n_parity"), ("ppo", "simple_alu")}
    for names, condition in conditions.items():
        ours = REPRODUCTION.tiers["full"].conditions[names]
        assert isinstance(condition.method, FirstLevelPpo)
        assert vars(condition.method) == vars(ours.method)
        assert (condition.task, condition.id == ours.id) == (ours.task, False)


def test_whole_tables_are_the_episodes_of_ppo_without_the_curriculum_alone() -> None:
    conditions = REPRODUCTION.variants["whole_tables"].conditions["full"]
    ((names, condition),) = conditions.items()
    assert names == ("ppo", "n_parity_direct")
    assert (condition.task.horizon, REPRODUCTION.tiers["full"].conditions[names].task.horizon) == (64, 1)
