"""The files of a project under attack: its settings, and the claims of its paper."""

from __future__ import annotations

TRIALS = 10
"""Trials of a condition of the tortured paper."""

REPORTS = 25
"""Reports of each."""

METHODS = ("quick", "steady", "fragile")

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

_HEAD = """
from evoclaims import claim

def says(name):
    return claim(name, says=f"{name} at full size", where="§1", smoke=f"{name} in small")
"""

_OF_ONE = """
@says("{0}")
def test_{0}(trials, verdict):
    verdict(trials("{0}", on="parity").solves_every_level.in_most_trials())
"""

_OF_TWO = """
@says("{0}-{1}")
def test_{0}_is_above_{1}(trials, verdict):
    verdict(trials("{0}", on="parity").last_success > trials("{1}", on="parity").last_success)
"""

CLAIMS = _HEAD + "".join(map(_OF_ONE.format, METHODS)) + "".join(map(_OF_TWO.format, METHODS, METHODS[1:]))
