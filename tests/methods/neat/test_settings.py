"""Hyperparameters that make no sense are refused in a sentence; the defaults are the paper's."""

from __future__ import annotations

import math
from typing import Any

import pytest

from evoclaims.core.canonical import canonical_json
from evoclaims.core.errors import UserError
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import PAPER, Attribute, Mutation, Settings, Species


def test_the_defaults_are_the_papers_table() -> None:
    assert Neat().settings == PAPER
    assert (PAPER.population, PAPER.nodes, PAPER.connections) == (5_000, 100, 400)
    assert (PAPER.activations, PAPER.output) == (("tanh",), "tanh")
    mutation = PAPER.mutation
    rates = (mutation.node_add, mutation.node_delete, mutation.connection_add, mutation.connection_delete)
    assert rates == (0.2, 0.1, 0.2, 0.2)
    for attribute, mean, std in ((mutation.bias, 0, 1), (mutation.response, 1, 0), (mutation.weight, 0, 1)):
        assert (attribute.mean, attribute.std) == (mean, std)
        assert (attribute.power, attribute.mutate_rate, attribute.replace_rate) == (0.15, 0.1, 0.015)
        assert attribute.bound == 5.0
    species = PAPER.species
    assert (species.most, species.threshold, species.disjoint, species.difference) == (50, 2.0, 1.0, 0.4)
    assert (species.stagnation, species.exempt, species.elites, species.survival) == (15, 2, 2, 0.01)
    assert (species.change, species.on_level_up) == (0.5, "reset")


def test_settings_are_told_apart_by_their_numbers() -> None:
    other = Settings(mutation=Mutation(node_add=0.1))
    assert canonical_json(other) != canonical_json(PAPER)
    assert hash(other) == hash(Settings(**vars(other)))


@pytest.mark.parametrize(
    "name", ["node_add", "node_delete", "connection_add", "connection_delete", "activation_replace"]
)
@pytest.mark.parametrize("value", [-0.1, 1.1, 2])
def test_what_is_no_probability_is_refused_by_its_name(name: str, value: float) -> None:
    with pytest.raises(UserError, match=f"{name}={value}. Write a number from 0 to 1"):
        Mutation(**{name: value})


IMPOSSIBLE: dict[type, list[dict[str, Any]]] = {
    Attribute: [
        *({name: -0.1} for name in ("mutate_rate", "replace_rate", "power")),
        {"mutate_rate": 0.7, "replace_rate": 0.4},
        *({"std": -1.0}, {"power": math.inf}, {"bound": 0.0}),
    ],
    Species: [
        *(
            {"most": 0},
            {"exempt": 0},
            {"elites": -1},
            {"stagnation": -1},
            {"threshold": 0.0},
            {"disjoint": -1.0},
            {"difference": math.nan},
            {"on_level_up": "forget"},
        ),
        *({name: wrong} for name, wrongs in (("survival", (0.0, 1.5)), ("change", (-0.5, 1.5))) for wrong in wrongs),
    ],
    Settings: [{"activations": ()}, {"activations": ("tanh", "step")}, {"output": "step"}, {"population": 99}],
}


@pytest.mark.parametrize(
    ("kind", "wrong"), [(kind, wrong) for kind, all_ in IMPOSSIBLE.items() for wrong in all_], ids=str
)
def test_what_is_impossible_is_refused(kind: type, wrong: dict[str, Any]) -> None:
    with pytest.raises(UserError):
        kind(**wrong)
    assert Settings(population=100).population == 100
