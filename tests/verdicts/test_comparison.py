"""The sides of a comparison: which of their trials belong to a tier."""

from __future__ import annotations

from pathlib import Path

import pytest

from evoclaims.paper.references import path_of
from evoclaims.verdicts.comparison import Side

pytestmark = pytest.mark.oldest


@pytest.mark.parametrize("folder", ["", "variants/full"])
@pytest.mark.parametrize("names", [("dqn", "parity"), ("dqn", "ALE/Pong-v5"), ("ours/full", "parity")])
def test_trials_belong_to_their_tier_whatever_the_names_of_method_and_task(folder: str, names: tuple[str, str]) -> None:
    name, other = (path_of(Path(folder), tier, *names).with_suffix("").as_posix() for tier in ("smoke", "full"))
    side = Side("both", {}, {name: (), other: ()})
    assert side.of(["smoke"]).trials.keys() == {name}
    assert side.of(["full"]).trials.keys() == {other}
