"""Two classes of one name have one id. A reproduction refuses them: one would be judged by the other's trials."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import FIXED_10
from evoclaims.methods.random_search import RandomSearch
from evoclaims.networks.mlp import Mlp
from evoclaims.paper.reproduction import Reproduction, Tier, Variant
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Budget, Condition

NETWORK = Mlp((4,))


@dataclass(frozen=True)
class Searcher(RandomSearch):
    """A method of the paper."""

    name: ClassVar[str] = "searcher"


# Another one, copied from it with its name; one with the name of the package's own; and one with a name of its own.
Copied, Posing, Named = (
    dataclass(frozen=True)(type(name, (RandomSearch,), {"name": of, "__module__": __name__}))
    for name, of in (("Copied", "searcher"), ("Posing", "random_search"), ("Named", "named"))
)
OtherParity = type("OtherParity", (NParity,), {"name": "n_parity", "__module__": __name__})


def _condition(method: Any, task: Any = NParity(3)) -> Condition:  # noqa: B008
    return Condition(method, task, "direct", Budget(generations=2))


def _reproduction(*conditions: Condition, variants: Any = ()) -> Reproduction:
    tier = Tier({(f"m{number}", "t"): one for number, one in enumerate(conditions)}, FIXED_10)
    return Reproduction("ours", "Ours", Path(), {"smoke": tier}, variants=dict(variants))


SEARCHER = _condition(Searcher(2, network=NETWORK))


@pytest.mark.parametrize(
    "other",
    [_condition(Copied(2, network=NETWORK)), _condition(Searcher(2, network=NETWORK), OtherParity(3))],
    ids=["method", "task"],
)
def test_two_classes_of_one_name_are_refused_in_either_order(other: Condition) -> None:
    assert other.id == SEARCHER.id
    for two in ((SEARCHER, other), (other, SEARCHER)):
        with pytest.raises(UserError, match=r"m0 on t and m1 on t would share their trials"):
            _reproduction(*two)


def test_so_is_one_with_the_name_of_the_packages_own_and_one_in_a_variant() -> None:
    own, posing = _condition(RandomSearch(2, network=NETWORK)), _condition(Posing(2, network=NETWORK))
    with pytest.raises(UserError, match=r"test_classes_of_one_name\.Posing\. Write another `name`"):
        _reproduction(own, posing)
    variant = Variant("another detail", {"smoke": {("m0", "t"): _condition(Copied(2, network=NETWORK))}})
    with pytest.raises(UserError, match="would share their trials"):
        _reproduction(SEARCHER, variants={"other": variant})


def test_other_names_fields_and_the_same_condition_twice_are_fine() -> None:
    found = _reproduction(
        SEARCHER,
        SEARCHER,
        _condition(Copied(3, network=NETWORK)),
        _condition(Named(2, network=NETWORK)),
        _condition(NETWORK),
    )
    assert len(found.tiers["smoke"].conditions) == 5  # the last has no id, which is an error of its claims


def test_trials_of_a_class_that_was_renamed_are_named(made: Any) -> None:
    trial: TrialResult = made(SEARCHER, 0, 1.0, code_hashes=SEARCHER.code)
    assert SEARCHER.edited_since([trial]) == ()
    (name,) = SEARCHER.code
    renamed = replace(trial, provenance={"code_hashes": {"old_place.Searcher": SEARCHER.code[name]}})
    assert SEARCHER.edited_since([trial, renamed]) == (name,)
    assert SEARCHER.edited_since([replace(trial, provenance={})]) == ()  # nothing is known


def test_two_conditions_never_share_a_file_of_reference_trials() -> None:
    one, other = ("ppo", "long-maze"), ("ppo-long", "maze")
    kept = _condition(RandomSearch(2, network=NETWORK))
    for conditions in ({one: kept, other: kept}, {other: kept, one: kept}):
        with pytest.raises(UserError, match=r"would have one file of reference trials, ppo-long-maze\.jsonl\. Write"):
            Reproduction("ours", "Ours", Path(), {"smoke": Tier(conditions, FIXED_10)})
