"""A GPU of its own for each worker of pytest-xdist, decided before jax starts there.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import os

import pytest

from evoclaims.core.errors import UserError
from evoclaims.trials.gpus import environment_of_worker, gpus


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config) -> None:
    """Let a worker of a project with claims see its GPU alone, before anything can import jax; options are parsed."""
    environment = environment_of_worker(early_config.known_args_namespace.claims_device, os.environ)
    if environment and _has_claims(early_config):
        os.environ.update(environment)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """Return how many workers `-n auto` means in a project with claims: one for each GPU; None without GPUs."""
    found = gpus(config.getoption("claims_device"))
    return len(found) if found and _has_claims(config) else None


def _has_claims(config: pytest.Config) -> bool:
    """Whether the project is one with claims: other projects that have evoclaims installed are left alone."""
    from evoclaims.paper.config import load_config

    try:
        load_config(config.rootpath)
    except UserError:
        return False
    return True
