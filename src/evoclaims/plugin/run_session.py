"""The session of a pytest run: what its claims are judged with, according to its options.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_text
from evoclaims.plugin.progress import progress_of

if TYPE_CHECKING:
    from evoclaims.claims.session import Session

SESSION: pytest.StashKey[Session] = pytest.StashKey()
"""Where a run keeps its session; if another one is put there, it judges the claims that follow."""


def make_session(config: pytest.Config) -> Session:
    """Return the session of a run: made once, from the project's reproduction and the options, and checked.

    Raises:
        UserError: when no claim can be judged with this store, device, sizes or names.
    """
    if SESSION in config.stash:
        return config.stash[SESSION]
    from evoclaims.claims.fetching import RunMissing, StoredOnly
    from evoclaims.claims.session import Session
    from evoclaims.paper.archive import Archive
    from evoclaims.paper.config import load_config, load_reproduction
    from evoclaims.trials import devices
    from evoclaims.trials.progress import ignore
    from evoclaims.trials.store import Store

    devices.configure()
    store = Store(_storage(config))
    project = load_config(config.rootpath)
    limit, any_version = project.seconds(config.getoption("claims_time_limit")), config.getoption("claims_any_version")
    run = RunMissing(store, config.getoption("claims_device"), progress_of(config) or ignore, limit, any_version)
    reproduction = load_reproduction(project)
    folder = reproduction.references if config.getoption("claims_committed") else None
    read = StoredOnly(Archive(store, folder, reproduction.imported))
    fetch = read if config.getoption("claims_stored") else run
    trials, variant = config.getoption("claims_trials"), config.getoption("claims_variant")
    made = Session(reproduction, store, fetch, trials, variant, run.again)
    for tier in reproduction.tiers:
        reproduction.tier(tier, made.variant)
        made.design(tier)
    _ = made.mutants  # a damaged file is reported before the first trial
    fetch.check()
    config.stash[SESSION] = made
    return made


def import_from_root(config: pytest.Config) -> None:
    """Let claim files import the project's modules, as they can where a command collects them."""
    path = config.rootpath / "pyproject.toml"
    with contextlib.suppress(OSError, ValueError, UserError):  # an unreadable file is reported later
        if "evoclaims" in read_text(path):  # other projects import nothing for it
            from evoclaims.paper.config import load_config, make_importable

            make_importable(load_config(config.rootpath).root)


def _storage(config: pytest.Config) -> Path:
    """Return the store's folder: the project's own, or the one that is named, relative to the current folder."""
    from evoclaims.trials.store_files import DEFAULT_ROOT

    named = config.getoption("claims_storage")
    if named is None:
        return config.rootpath / DEFAULT_ROOT
    if not named:
        raise UserError("--claims-storage names no folder. Name one, or leave it out for the project's own store.")
    folder = Path(config.invocation_params.dir, named)
    if config.getoption("claims_stored") and not os.path.lexists(folder):
        raise UserError(
            f"There is no trial store {folder}: the folder does not exist. Check its name, or leave --claims-storage "
            "out for the project's own store."
        )
    return folder
