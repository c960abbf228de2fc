"""The project around the current folder: its reproduction, and its claims judged from the store."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.suite.archive import Archive
from evoclaims.suite.config import SuiteConfig, find_root, load_config, load_reproduction
from evoclaims.suite.report import ClaimReport
from evoclaims.suite.reproduction import Reproduction
from evoclaims.trials import devices
from evoclaims.trials.store import Store


def open_project() -> tuple[SuiteConfig, Reproduction]:
    """Return the settings and the reproduction of the project that the current folder lies in."""
    devices.configure()
    config = load_config(find_root(Path.cwd()))
    return config, load_reproduction(config)


def open_store(name: str) -> Store:
    """Return the store in the folder `name`, relative to the current one."""
    return Store(Path(name))


def open_archive(storage: str, reproduction: Reproduction) -> Archive:
    """Return the trials of the store in the folder `storage`, and the reproduction's reference trials."""
    return Archive(open_store(storage), reproduction.references)


def judge_stored(config: SuiteConfig, storage: str, tier: str, variant: str = "") -> list[ClaimReport]:
    """Judge a tier's claims from stored trials, and committed reference trials where those are missing; run nothing.

    Raises:
        UserError: when the claims cannot be collected.
    """
    gathered = _Gathered()
    arguments = [
        str(config.root / config.claims),
        f"--rootdir={config.root}",
        "--claims-stored",
        "--claims-committed",
        f"--claims-storage={Path(storage).absolute()}",
        f"--claims-tier={tier}",
        f"--claims-variant={variant}",
        "-pno:terminal",
        "-pno:cacheprovider",
        "-pno:xdist",
        # this process has imported evoclaims before pytest could look at its asserts
        "-Wignore::pytest.PytestAssertRewriteWarning",
    ]
    output = io.StringIO()
    with contextlib.redirect_stderr(output):
        status = pytest.main(arguments, plugins=[gathered])
    if gathered.broken or status in (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.INTERNAL_ERROR):
        detail = "\n".join([*gathered.broken, output.getvalue().strip()]).strip()
        raise UserError(f"The claims in {config.root / config.claims} cannot be collected:\n{detail}")
    return gathered.reports


class _Gathered:
    """A pytest plugin that keeps the reports of a run."""

    def __init__(self) -> None:
        self.reports: list[ClaimReport] = []
        self.broken: list[str] = []

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Keep what broke a claim file."""
        if report.failed:
            self.broken.append(f"{report.nodeid}: {report.longreprtext}")

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Keep the reports that the claims plugin has gathered."""
        summary: Any = session.config.pluginmanager.get_plugin("claims-summary")
        self.reports = list(summary.reports)
