"""Claims judged within a command: collected by one run of pytest, which ignores the settings of other runs."""

from __future__ import annotations

import contextlib
import gc
import io
import os
from collections.abc import Generator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Final

import pytest

from evoclaims.claims.collected import claim_tests
from evoclaims.claims.session import Session
from evoclaims.core.errors import UserError, in_one_line
from evoclaims.paper.config import SuiteConfig
from evoclaims.plugin.options import SESSION
from evoclaims.plugin.summary import ATTRIBUTE
from evoclaims.verdicts import history
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import last_runs

_ENVIRONMENT: Final = ("PYTEST_ADDOPTS", "PYTEST_PLUGINS", "PYTEST_DISABLE_PLUGIN_AUTOLOAD")
"""Variables that change which tests a run of pytest collects, and when it stops."""

_ALONE: Final = (
    "-pevoclaims",
    "-pno:claims-summary",
    "-pno:terminal",
    "-pno:cacheprovider",
    "-pno:xdist",
    "-orequired_plugins=",  # a plugin left out above may be required
    # this process imported evoclaims before pytest could rewrite its asserts
    "-Wignore::pytest.PytestAssertRewriteWarning",
)
MOST_NAMES: Final = 3
"""Most names of tests that an error lists."""


def judge(config: SuiteConfig, asked: Sequence[tuple[Session, str]]) -> list[list[ClaimReport]]:
    """Return the reports of all claims of a tier, for each session and tier asked for; the claims are collected once.

    Options in the project's settings (addopts) and in the environment do not change which claims are judged.

    Raises:
        UserError: when the claims cannot be collected, or something keeps one from being judged.
        KeyboardInterrupt: when the run is interrupted.
    """
    run = _Run(config, asked)
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors), pytest.MonkeyPatch.context() as environment:
        for name in _ENVIRONMENT:
            environment.delenv(name, raising=False)
        gc.freeze()  # the garbage collection at the end of a run of pytest takes long with all imported objects
        try:
            status = pytest.main([*run.arguments], plugins=[run])
        except (Exception, SystemExit) as error:  # such as a plugin that does not import
            run.troubles.append(_sentence(error, config.root))
            status = pytest.ExitCode.INTERNAL_ERROR
        finally:
            gc.unfreeze()
    if run.interrupted:
        raise KeyboardInterrupt
    if not run.troubles and status in (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.INTERNAL_ERROR):
        run.troubles.append(" ".join(errors.getvalue().split()).removeprefix("ERROR: ").removesuffix("."))
    if run.troubles:
        rest = f", and {len(run.troubles) - 1} more such errors" if len(run.troubles) > 1 else ""
        raise UserError(f"The claims in {run.claims} cannot be collected: {run.troubles[0]}{rest}.")
    if not run.has_claims:
        raise UserError(
            f"No claim found in {run.claims}: claims are in files {run.files}, on functions {run.functions}, each with "
            "@claim(...)."
        )
    run.check_complete()
    return [last_runs(reports) for reports in run.reports]


class _Run:
    """A pytest plugin that takes no options from outside, judges claims in several ways, and keeps their reports."""

    def __init__(self, config: SuiteConfig, asked: Sequence[tuple[Session, str]]) -> None:
        """Start empty."""
        self.claims = config.root / config.claims
        tiers = " or ".join({tier: None for _, tier in asked})
        # From the current folder, since pytest reads [, :: and $ in an argument as more than a path.
        claims, root = (os.path.join(os.curdir, os.path.relpath(path)) for path in (self.claims, config.root))
        self.arguments = (claims, f"--rootdir={root}", f"-m{tiers}", *_ALONE)
        self.reports: list[list[ClaimReport]] = [[] for _ in asked]
        self.troubles: list[str] = []
        self.interrupted = False
        self.files = self.functions = ""
        self._root = config.root
        self._asked = asked
        self._collected: list[pytest.Item] = []
        self._now: list[ClaimReport] = []
        self._last: object = None

    def pytest_configure(self, config: pytest.Config) -> None:
        """Keep the plugin from making a session of its own."""
        config.stash[SESSION] = self._asked[0][0]
        self.files = " or ".join(config.getini("python_files"))
        self.functions = " or ".join(f"{name.removesuffix('*')}*" for name in config.getini("python_functions"))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_load_initial_conftests(
        self, early_config: pytest.Config, args: list[str]
    ) -> Generator[None, object, object]:
        """Leave out all arguments but our own, except the import mode; plugins are loaded by now."""
        try:
            return (yield)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a conftest.py may raise SystemExit as well
            self.troubles.append(_sentence(error.__cause__ or error, self._root))
            raise pytest.UsageError from error
        finally:
            args[:] = [*self.arguments, f"--import-mode={early_config.known_args_namespace.importmode}"]

    def pytest_exception_interact(
        self, node: pytest.Item | pytest.Collector, call: pytest.CallInfo[object], report: object
    ) -> None:
        """Keep what broke a file of claims."""
        if isinstance(report, pytest.CollectReport) and call.excinfo is not None:
            sentence = _sentence(call.excinfo.value, self._root)
            # pytest 8 names a test that it cannot collect without its file.
            nowhere = isinstance(call.excinfo.value, pytest.fail.Exception) and node.path.name not in sentence
            self.troubles.append(f"{node.nodeid}: {sentence}" if nowhere else sentence)

    def pytest_internalerror(self, excinfo: pytest.ExceptionInfo[BaseException]) -> bool:
        """Keep what a plugin or a conftest.py has raised, and print nothing of it."""
        self.troubles.append(_sentence(excinfo.value, self._root))
        return True

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        """Tell the user's Ctrl-C from pytest.exit(...), and from pytest's own ways to end a run."""
        self.interrupted = excinfo.type is KeyboardInterrupt

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        """Note each collected test before anything can leave it out."""
        self._collected.append(item)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run the claims of a tier once for each session that asks for it."""
        claims = claim_tests(session.items)
        for (judging, tier), reports in zip(self._asked, self.reports, strict=True):
            session.config.stash[SESSION], self._now = judging, reports
            items = [item for item in session.items if item in claims and claims[item].tier == tier]
            for item, following in zip_longest(items, items[1:]):
                if self.troubles or session.shouldstop or session.shouldfail:
                    return True
                session.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
                if isinstance(item.parent, pytest.Class):  # a test that runs again needs a new object of its class, too
                    vars(item).pop("_instance", None)
                    vars(item).pop("_obj", None)
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep a claim's report."""
        plain = getattr(report, ATTRIBUTE, None)
        if plain is not None and plain is not self._last:  # the report of a test's end has it, too
            self._now.append(ClaimReport.from_json(plain))
            self._last = plain

    @property
    def has_claims(self) -> bool:
        """Whether any claim was collected."""
        return bool(claim_tests(self._collected))

    def check_complete(self) -> None:
        """Raise if claims were collected but have no report.

        Raises:
            UserError: when there are such claims.
        """
        tests = {item.nodeid: test for item, test in claim_tests(self._collected).items()}
        for (_, tier), reports in zip(self._asked, self.reports, strict=True):
            judged = {history.key_of(report) for report in reports}
            wanted = {name: test for name, test in tests.items() if test.tier == tier}
            left = [name for name, test in wanted.items() if test.key not in judged]
            if left:
                listed = ", ".join(left[:MOST_NAMES]) + (" and others" if len(left) > MOST_NAMES else "")
                raise UserError(
                    f"{len(left)} of {len(wanted)} claims of the {tier} tier were collected and not "
                    f"judged ({listed}): a plugin, a conftest.py or pytest.exit() left them out. Mark a "
                    "claim that is not to be judged with pytest.mark.skip."
                )


def _sentence(error: BaseException, root: Path) -> str:
    """Return in one line what kept claims from being collected."""
    if isinstance(error, pytest.Collector.CollectError | pytest.UsageError | pytest.fail.Exception):
        cause = error.__cause__
        if isinstance(cause, ImportError | SyntaxError) and cause.msg:  # pytest's message is their traceback
            return in_one_line(cause, root)
        return " ".join(str(error).split()).removesuffix(".")
    return in_one_line(error, root)
