"""The options of the pytest plugin, the check of their values before anything is collected, and what they select."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

import pytest

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.tiers import TIERS

if TYPE_CHECKING:
    from evoclaims.claims.collected import ClaimTest

_PATHS: Final = ("--claims-storage", "--claims-json")
"""Options whose values are paths."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("claims", "claims of a paper (evoclaims)")
    group.addoption("--claims-storage", metavar="DIR", help="folder of trials (.evoclaims in the project's root)")
    group.addoption("--claims-tier", metavar="TIER", help="judge this tier's claims: smoke or full; as -m TIER")
    group.addoption("--claims-trials", metavar="N", type=int, help="judge by one look at N trials a condition")
    group.addoption("--claims-only", metavar="IDS", help="judge only these claims, such as G1,G7 or G6[neat-ppo]")
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
    tier, changes = config.getoption("claims_tier"), config.getoption("claims_compare_fail")
    try:
        _check_root(config)
        if tier is not None and tier not in TIERS:
            raise UnknownNameError("tier", tier, TIERS)
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
    """Return the tiers that the options select; "full" only when --claims-tier or -m names it positively."""
    tier = config.getoption("claims_tier")
    if tier is not None:
        return {tier}
    named = re.sub(r"\bnot\s+full\b", "", config.getoption("markexpr") or "")
    return set(TIERS) if re.search(r"\bfull\b", named) else {"smoke"}


def wanted_claims(config: pytest.Config, tests: Iterable[ClaimTest], *, incomplete: bool) -> set[str]:
    """Return the ids, and the names with a case such as G1[n_parity], that --claims-only selects.

    `incomplete` says that pytest has failed to collect something.
    """
    option, ids = config.getoption("claims_only"), {test.claim.id for test in tests}
    if option is None:
        return ids
    from evoclaims.claims.selection import selected

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


def _check_changes(config: pytest.Config, changes: str) -> None:
    """Refuse changes of verdicts that never happen, or that a run would never see."""
    from evoclaims.verdicts.transitions import parse_patterns

    parse_patterns(changes)
    if config.getoption("claims_variant"):
        raise UserError(
            "--claims-compare-fail compares verdicts under the protocol itself, and --claims-variant "
            "judges under another one. Leave one of them out."
        )
