"""The options of the pytest plugin, the check of their values before anything is collected, and what they select.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

import pytest

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_text
from evoclaims.core.tiers import TIERS
from evoclaims.plugin.progress import progress_of

if TYPE_CHECKING:
    from evoclaims.claims.claim import ClaimTest
    from evoclaims.claims.session import Session
    from evoclaims.execution.ahead import Ahead
    from evoclaims.paper.config import SuiteConfig
    from evoclaims.paper.reproduction import Reproduction
    from evoclaims.trials.store import Store

AHEAD: Final[pytest.StashKey[Ahead]] = pytest.StashKey()
"""Where a run keeps what runs its trials in processes of their own."""

_PATHS: Final = ("--claims-storage", "--claims-json")
"""Options whose values are paths."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("claims", "claims of a paper (evoclaims)")
    group.addoption("--claims-storage", metavar="DIR", help="folder of trials (.evoclaims in the project's root)")
    group.addoption("--claims-trials", metavar="N", type=int, help="judge by one look at N trials a condition")
    group.addoption("--claims-only", metavar="IDS", help="judge only these claims, such as G1,G7 or G6[neat-ppo]")
    group.addoption(
        "--claims-processes",
        metavar="N",
        default="1",
        help="processes that run trials while claims wait for theirs (1: this one, on all devices); auto: one per GPU "
        "(two where NVIDIA's MPS runs), or without GPUs as many as keep the cores busy",
    )
    group.addoption("--claims-device", metavar="DEVICE", default="auto", help="auto (default), cpu or gpu")
    group.addoption(
        "--claims-time-limit",
        metavar="TIME",
        help="time that a batch of trials may take, such as 90s, 30min, 24h or none (24h, or what pyproject.toml says)",
    )
    group.addoption("--claims-json", metavar="FILE", help="write all verdicts to FILE, also when there are none")
    group.addoption(
        "--claims-undecided",
        choices=("report", "fail"),
        default="report",
        help="fail: inconclusive claims, or a run that has judged none of its claims, end with status 1 (report)",
    )
    group.addoption(
        "--claims-compare-fail",
        metavar="CHANGES",
        help="end with status 1 when a verdict differs from the accepted one like this: 'supported->refuted', "
        "'*->error,supported->*'; a lost support (supported->inconclusive) then fails, too, unless draws from the "
        "claim's pilots lose it in more than 1 of 100",
    )
    group.addoption("--claims-stored", action="store_true", help="judge from stored trials alone; run nothing")
    group.addoption(
        "--claims-any-version",
        action="store_true",
        help="judge stored trials whatever versions they were made with; run only what is missing",
    )
    group.addoption("--claims-variant", metavar="NAME", default="", help="judge under a variant of the protocol")
    group.addoption(
        "--claims-committed",
        action="store_true",
        help="with --claims-stored: take what the store lacks from the committed reference trials, and compare the "
        "rest with them",
    )


def check(config: pytest.Config) -> None:
    """Refuse values with which no run is possible.

    Raises:
        pytest.UsageError: with a sentence.
    """
    changes, processes = config.getoption("claims_compare_fail"), config.getoption("claims_processes")
    try:
        _check_root(config)
        if processes != "1":
            from evoclaims.execution.host import processes_of

            processes_of(processes, "--claims-processes")
        if changes is not None:
            _check_changes(config, changes)
        if config.getoption("claims_committed") and not config.getoption("claims_stored"):
            raise UserError(
                "--claims-committed lets --claims-stored use committed trials where the store has none. It does "
                "nothing alone: add --claims-stored, or leave it out."
            )
    except UserError as error:
        raise pytest.UsageError(str(error)) from error


def wanted_tiers(config: pytest.Config) -> set[str]:
    """Return the tiers that the options select; "full" only when -m names it positively."""
    named = re.sub(r"\bnot\s+full\b", "", config.getoption("markexpr") or "")
    return set(TIERS) if re.search(r"\bfull\b", named) else {"smoke"}


def wanted_claims(config: pytest.Config, tests: Iterable[ClaimTest], *, incomplete: bool) -> set[str]:
    """Return the ids, and the names with a case such as G1[n_parity], that --claims-only selects.

    `incomplete` says that pytest has failed to collect something.
    """
    option, ids = config.getoption("claims_only"), {test.claim.id for test in tests}
    if option is None:
        return ids
    from evoclaims.claims.claim_names import selected

    return selected(option, ids | {test.key[1] for test in tests}, incomplete=incomplete)


def _check_root(config: pytest.Config) -> None:
    """Refuse a root above the project's.

    pytest looks for its root before it knows the options of plugins: in `--claims-storage DIR` an existing DIR outside
    of the project is a place of tests to it.
    """
    spaced = [option for option in _PATHS if option in config.invocation_params.args]
    if not spaced:
        return
    from evoclaims.paper.config import find_root

    try:
        project = find_root(config.invocation_params.dir)
    except UserError:
        return
    if not config.rootpath.is_relative_to(project):
        raise UserError(
            f"pytest uses {config.rootpath} as the root of this run, not the project {project}: it reads "
            f"an existing path after a space as a path of tests. Write {' and '.join(spaced)} with =, as "
            f"in {spaced[0]}=PATH."
        )


def check_project(config: pytest.Config, items: Iterable[pytest.Item]) -> None:
    """Refuse claims of another project: they would be judged by this one's methods, tasks, budgets and trials.

    Raises:
        UserError: when a claim is of another project.
    """
    from evoclaims.paper.config import find_root

    for folder, item in {item.path.parent: item for item in items}.items():
        own = config.rootpath
        with suppress(UserError):  # no project is said to be broken where its settings are read
            own = find_root(folder)
        if own.resolve() != config.rootpath.resolve():
            raise UserError(
                f"{item.nodeid} is a claim of the project {own}, and this run judges by {config.rootpath}. "
                "Run each project's claims on their own."
            )


def _check_changes(config: pytest.Config, changes: str) -> None:
    """Refuse changes of verdicts that never happen, or that a run would never see."""
    from evoclaims.verdicts.transitions import parse_patterns

    parse_patterns(changes)
    if config.getoption("claims_variant"):
        raise UserError(
            "--claims-compare-fail compares verdicts under the protocol itself, and --claims-variant "
            "judges under another one. Leave one of them out."
        )


def make_session(config: pytest.Config) -> Session:
    """Return the session of a run: made once, from the project's reproduction and the options, and checked.

    Raises:
        UserError: when no claim can be judged with this store, device, sizes or names.
    """
    from evoclaims.claims.session import SESSION, Session

    if SESSION in config.stash:
        return config.stash[SESSION]
    from evoclaims.claims.fetching import RunMissing, StoredOnly
    from evoclaims.paper.archive import Archive
    from evoclaims.paper.config import load_config, load_reproduction
    from evoclaims.trials import devices
    from evoclaims.trials.progress import ignore
    from evoclaims.trials.store import Store

    devices.configure()
    store = Store(_storage(config))
    project = load_config(config.rootpath)
    limit, any_version = project.seconds(config.getoption("claims_time_limit")), config.getoption("claims_any_version")
    reproduction = load_reproduction(project)
    device, watch, more = config.getoption("claims_device"), progress_of(config) or ignore, reproduction.seeds_for_drift
    ahead = _ahead(config, reproduction, store, limit)
    if ahead is None:
        run = RunMissing(store, device, watch, limit, any_version, for_drift=more)
    else:
        config.stash[AHEAD] = ahead
        more = {} if ahead.host.gpus else more
        run = RunMissing(
            store, "cpu" if ahead.host.gpus else device, watch, limit, any_version, ahead.wait, for_drift=more
        )
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


def _ahead(config: pytest.Config, reproduction: Reproduction, store: Store, limit: float) -> Ahead | None:
    """Return what runs trials in processes of their own; None where this process runs them, or nothing is run."""
    from evoclaims.execution.ahead import Ahead
    from evoclaims.execution.host import host_of
    from evoclaims.execution.worker import WorkOrder

    asked, device = config.getoption("claims_processes"), config.getoption("claims_device")
    host = host_of(asked, device, "--claims-processes")
    if host.alone or config.getoption("claims_stored") or config.getoption("setupplan", False):
        return None
    if hasattr(config, "workerinput"):
        raise UserError("Workers of pytest-xdist run trials themselves: leave out -n, or --claims-processes.")
    line = progress_of(config)
    order = WorkOrder(
        storage=str(store.root.resolve()),
        tier="",
        device=device,
        first_seed=0,
        trials=0,
        variant=config.getoption("claims_variant"),
        time_limit=config.getoption("claims_time_limit"),
        any_version=config.getoption("claims_any_version"),
        root=str(config.rootpath),
    )
    return Ahead(host, order, reproduction, store, limit, line.remark if line else lambda text: None)


def import_from_root(config: pytest.Config) -> None:
    """Let claim files import the project's modules, as they can where a command collects them."""
    if names_us(config) and (settings := settings_of(config)):  # other projects import nothing for it
        from evoclaims.paper.config import make_importable

        make_importable(settings.root)


def settings_of(config: pytest.Config) -> SuiteConfig | None:
    """Return the project's settings; None if it has no claims, or they cannot be read, which a later error says."""
    from evoclaims.paper.config import load_config

    try:
        return load_config(config.rootpath)
    except UserError:
        return None


def names_us(config: pytest.Config) -> bool:
    """Whether the settings of the project name evoclaims: it may have claims."""
    try:
        return "evoclaims" in read_text(config.rootpath / "pyproject.toml")
    except (OSError, ValueError, UserError):
        return False


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
