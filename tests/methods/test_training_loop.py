"""What may stand as a training loop, and how it is named."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from evoclaims.core.canonical import as_plain
from evoclaims.core.errors import UserError
from evoclaims.core.portable import from_plain, to_plain
from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.sensors import Rangefinders
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.networks.mlp import Mlp
from evoclaims.trials.spec import Budget, Condition


def train(task: Any, seed: int, budget: Any, rate: float = 0.1) -> dict[str, float]:
    return {"last_fitness": rate}


class Trainer:
    def train(self, task: Any, seed: int, budget: Any) -> dict[str, float]:
        return {}


def _id(loop: TrainingLoop) -> str:
    return Condition(loop, NParity(2), "whole_budget", Budget(environment_steps=1)).id


def test_a_loop_is_known_by_its_function_and_settings_and_not_by_its_packages() -> None:
    loop = TrainingLoop(train, {"rate": 0.2}, packages=("numpy",))
    assert as_plain(loop) == {"function": f"{__name__}:train", "settings": {"rate": 0.2}}
    assert loop.name == "train"
    assert loop == TrainingLoop(f"{__name__}:train", {"rate": 0.2}, packages=("numpy",))
    assert _id(loop) == _id(TrainingLoop(train, {"rate": 0.2}, packages=()))
    others = [TrainingLoop(train, packages=()), TrainingLoop(train, {"rate": 0.2}, packages=(), revision=2)]
    assert len({_id(one) for one in (loop, *others)}) == 3
    assert hash(loop) == hash(TrainingLoop(train, {"rate": 0.2}, packages=("numpy",)))


def test_what_another_process_cannot_call_is_a_sentence() -> None:
    def inside(task: Any, seed: int, budget: Any) -> None: ...

    for function in (inside, lambda task, seed, budget: {}):
        with pytest.raises(UserError, match="cannot be imported by another process"):
            TrainingLoop(function, packages=())
    with pytest.raises(UserError, match=r"train does not take \(task, seed, budget\) and the settings speed: got"):
        TrainingLoop(train, {"speed": 1.0}, packages=())
    for place in ("train", 3, "our_loops:"):
        with pytest.raises(UserError, match="A training loop is a function, or its place such as"):
            TrainingLoop(place, packages=())  # type: ignore[arg-type]
    with pytest.raises(UserError, match="settings=0.2 of a training loop is not a table of arguments by name"):
        TrainingLoop(train, 0.2, packages=())  # type: ignore[arg-type]
    with pytest.raises(UserError, match="TrainingLoop has deterministic='no'. Write True or False"):
        _id(TrainingLoop(train, packages=(), deterministic="no"))  # type: ignore[arg-type]
    for value in ({1}, {1: 2.0}, NParity, [Mlp((4,))]):  # of dataclasses an id would have the fields, but not the class
        with pytest.raises(
            UserError, match=r"The setting 'rate' of a training loop is .* Write numbers, words, and lists or tables"
        ):
            TrainingLoop(train, {"rate": value}, packages=())
    with pytest.raises(UserError, match=r"finds <function Trainer.train at .*, not <bound method"):
        TrainingLoop(Trainer().train, packages=())


def test_it_has_no_champion_and_says_so() -> None:
    loop = TrainingLoop(train, packages=())
    for call in (loop.init, loop.best):
        with pytest.raises(UserError, match="'train' is a training loop"):
            call(None, None)


@pytest.mark.parametrize(
    "value",
    [
        NParity(4, sampling="sampled"),
        Obstacles(sensor=Rangefinders()),
        Mlp((4, 4)),
        {"a": (1, [2.5, None], -math.inf), "b": {1: "x"}, "c": train},
    ],
    ids=lambda value: type(value).__name__,
)
def test_another_process_makes_equal_values(value: Any) -> None:
    assert from_plain(json.loads(json.dumps(to_plain(value), allow_nan=False))) == value
