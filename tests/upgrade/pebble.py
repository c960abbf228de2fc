"""A small library in six releases, as wheels, and a paper about a network that is built from it.

Release 1.2 makes the network's outputs larger, which changes fitness and no success; from 1.4 on they are negated, so
that it solves nothing. 1.3 asks for what nobody has, so that it cannot be installed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from wheels import write_wheel

RELEASES: Final = tuple(f"1.{minor}" for minor in range(6))
LARGER, UNINSTALLABLE, NEGATED = "1.2", "1.3", "1.4"

PAPER: Final = '''
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pebble

from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.hand_built import HandBuilt, circuit_for
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.spec import Budget
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class Pebbles(HandBuilt):
    """A network that is right, if its library is."""

    name: ClassVar[str] = "pebbles"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("pebble",)

    def best(self, task, state):
        return circuit_for(task).policy(pebble.FACTOR)


BUDGET = Budget(generations=1, reports=1)
CONDITIONS = {
    (name, "parity"): Condition(method, NParity(2), "curriculum", BUDGET)
    for name, method in {"pebbles": Pebbles(), "plain": HandBuilt()}.items()
}
REPRODUCTION = Reproduction(
    name="pebbles",
    title="A Paper About Pebbles",
    folder=Path(__file__).parent,
    tiers={"smoke": Tier(CONDITIONS, Design.fixed(10)), "full": Tier(CONDITIONS, Design.fixed(10))},
)
'''

CLAIMS: Final = """
import pytest
from evoclaims import claim


@claim("P1", says="It solves parity", where="§1", smoke="It solves 2-parity")
@pytest.mark.parametrize("method", ["pebbles", "plain"])
def test_it_solves_parity(method, trials, verdict):
    verdict(trials(method, on="parity").solves_every_level.in_most_trials())
"""

PYPROJECT: Final = '[tool.evoclaims]\nreproduction = "paper"\n'


def write_project(folder: Path) -> None:
    """Write the paper and its claims."""
    (folder / "claims").mkdir(parents=True)
    (folder / "pyproject.toml").write_text(PYPROJECT)
    (folder / "paper.py").write_text(PAPER)
    (folder / "claims" / "test_claims.py").write_text(CLAIMS)


def write_wheels(folder: Path) -> None:
    """Write a wheel of each release."""
    folder.mkdir(parents=True)
    for version in RELEASES:
        factor = -1.0 if _comes(version, NEGATED) else 2.0 if _comes(version, LARGER) else 1.0
        needs = "Requires-Dist: gravel-that-nobody-has\n" if version == UNINSTALLABLE else ""
        write_wheel(folder, "pebble", version, f"FACTOR = {factor}\n", needs)


def _comes(version: str, since: str) -> bool:
    """Whether a release is a certain one or a later one."""
    return RELEASES.index(version) >= RELEASES.index(since)
