"""The files of a project under attack: its settings, and the claims of its paper."""

from __future__ import annotations

TRIALS = 10
"""Trials of a condition of the tortured paper."""

REPORTS = 25
"""Reports of each."""

PYPROJECT = """
[tool.evoclaims]
reproduction = "tortured_paper"

[tool.pytest.ini_options]
testpaths = ["claims"]
addopts = [
    "--strict-markers", "--strict-config", "-p", "no:cacheprovider",
    "-p", "no:anyio", "-p", "no:benchmark", "-p", "no:hypothesispytest", "-p", "no:jaxtyping",
]
filterwarnings = ["error"]
"""

CLAIMS = """
from evoclaims import claim

def says(name):
    return claim(name, says=f"{name} at full size", where="§1", smoke=f"{name} in small")

@says("quick")
def test_quick(trials, verdict):
    verdict(trials("quick", on="parity").solves_every_level.in_most_trials())

@says("steady")
def test_steady(trials, verdict):
    verdict(trials("steady", on="parity").solves_every_level.in_most_trials())

@says("fragile")
def test_fragile(trials, verdict):
    verdict(trials("fragile", on="parity").solves_every_level.in_most_trials())

@says("quick-steady")
def test_quick_is_above_steady(trials, verdict):
    verdict(trials("quick", on="parity").last_success > trials("steady", on="parity").last_success)

@says("steady-fragile")
def test_steady_is_above_fragile(trials, verdict):
    verdict(trials("steady", on="parity").last_success > trials("fragile", on="parity").last_success)
"""


CLAIM = """
@says("{name}")
def test_{name}(trials, verdict):
    verdict(trials("{name}", on="parity").solves_every_level.in_most_trials())
"""


def methods(further: int) -> list[str]:
    """Return the names of the paper's three methods and of so many further ones."""
    return ["quick", "steady", "fragile", *(f"walker{number:05}" for number in range(further))]


def claims(further: int) -> str:
    """Return the module of claims: those on the three methods, and one on each further method."""
    return CLAIMS + "".join(CLAIM.format(name=name) for name in methods(further)[3:])
