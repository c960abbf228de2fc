"""All claims of a project, collected by one run of pytest that ignores the settings of other runs; then judged."""

from __future__ import annotations

import contextlib
import gc
import io
import os
import warnings
from collections.abc import Collection, Generator, Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import pytest

from evoclaims.claims.claim_names import claim_tests
from evoclaims.claims.collected import Collected, Recorder, renew
from evoclaims.claims.report_making import broken
from evoclaims.claims.session import SESSION, WITHIN, Session
from evoclaims.core.errors import UserError, in_one_line
from evoclaims.paper.config import SuiteConfig
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


Asked = Sequence[tuple[Recorder, Collection[str]]]
"""Under which protocols claims are collected, and at which tiers."""


def collect(config: SuiteConfig, asked: Asked) -> list[list[Collected]]:
    """Return all claims of some tiers under the protocol of each recorder.

    Each test is called once, and again for a variant that changes a condition that it asks for.

    Options in the project's settings (addopts) and in the environment do not change which claims are collected.

    Raises:
        UserError: when the claims cannot be collected, or something keeps one from being called.
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
    run.check_complete()
    return [recorder.found for recorder, _ in asked]


def judge_all(session: Session, collected: Iterable[Collected], root: Path) -> list[ClaimReport]:
    """Return the reports of collected claims from the trials of a session, of the project in `root`.

    Claims that this session has not judged when they were called are judged now.
    """
    last: dict[tuple[str, str], ClaimReport] = {}
    made = []
    for one in collected:
        report = one.report
        if one.assertion is not None and one.reader is not session:
            try:
                # What a project's measures print is not shown, and what they warn of is treated as in the test.
                with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings(record=True):
                    warnings.filters = list(one.filters)
                    report = session.settle(one.test, one.assertion, one.readings)
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                report = broken(one.test, error, root)
        if not one.skipped:
            report = last[one.test.key] = session.complete(report, one.expectation, last.get(one.test.key))
        made.append(report)
    return last_runs(made)


class _Run:
    """A pytest plugin that takes no options from outside, and calls claims under several protocols."""

    def __init__(self, config: SuiteConfig, asked: Asked) -> None:
        """Start empty."""
        self.claims = config.root / config.claims
        tiers = " or ".join({tier: None for _, tiers in asked for tier in tiers})
        # From the current folder, since pytest reads [, :: and $ in an argument as more than a path.
        claims, root = (os.path.join(os.curdir, os.path.relpath(path)) for path in (self.claims, config.root))
        self.arguments = (claims, f"--rootdir={root}", f"-m{tiers}", *_ALONE)
        self.troubles: list[str] = []
        self.interrupted = False
        self.files = self.functions = ""
        self._root = config.root
        self._asked = asked
        self._collected: list[pytest.Item] = []

    def pytest_configure(self, config: pytest.Config) -> None:
        """Keep the plugin from making a session of its own, and from ending the process."""
        config.stash[WITHIN] = True
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
        """Call each claim once under each protocol that changes what it asks for."""
        claims = claim_tests(session.items)
        known: dict[pytest.Item, list[list[Collected]]] = {item: [] for item in claims}
        for recorder, tiers in self._asked:
            session.config.stash[SESSION] = recorder
            recorder.tests.update((test.key, test) for test in claims.values())
            same = {item: _same(recorder, before) for item, before in known.items() if claims[item].tier in tiers}
            items = [item for item in same if not same[item]]
            following = dict(pairwise(items))
            for item in same:
                if self.troubles or session.shouldstop or session.shouldfail:
                    return True
                if same[item]:
                    recorder.found.extend(same[item])
                    continue
                begun = len(recorder.found)
                session.config.hook.pytest_runtest_protocol(item=item, nextitem=following.get(item))
                known[item].append(recorder.found[begun:])
                renew(item)
        return True

    def check_complete(self) -> None:
        """Raise if no claims were collected, or some that have no report.

        Raises:
            UserError: when that is so.
        """
        tests = {item.nodeid: test for item, test in claim_tests(self._collected).items()}
        if not tests:
            raise UserError(
                f"No claim found in {self.claims}: claims are in files {self.files}, on functions {self.functions}, "
                "each with @claim(...)."
            )
        for recorder, tier in ((recorder, tier) for recorder, tiers in self._asked for tier in tiers):
            called = {one.test.key for one in recorder.found}
            wanted = {name: test for name, test in tests.items() if test.tier == tier}
            left = [name for name, test in wanted.items() if test.key not in called]
            if left:
                listed = ", ".join(left[:MOST_NAMES]) + (" and others" if len(left) > MOST_NAMES else "")
                raise UserError(
                    f"{len(left)} of {len(wanted)} claims of the {tier} tier were collected and not "
                    f"judged ({listed}): a plugin, a conftest.py or pytest.exit() left them out. Mark a "
                    "claim that is not to be judged with pytest.mark.skip."
                )


def _same(recorder: Recorder, before: Iterable[list[Collected]]) -> list[Collected]:
    """Return what a test asserted under another protocol, if it would assert the same under that of a recorder.

    A session of the protocol itself judges each claim during a call of its own.
    """
    if recorder.reader is not None and not recorder.variant:
        return []
    return next((found for found in before if found and all(map(recorder.has_conditions_of, found))), [])


def _sentence(error: BaseException, root: Path) -> str:
    if isinstance(error, pytest.Collector.CollectError | pytest.UsageError | pytest.fail.Exception):
        cause = error.__cause__
        if isinstance(cause, ImportError | SyntaxError) and cause.msg:  # pytest's message is their traceback
            return in_one_line(cause, root)
        return " ".join(str(error).split()).removesuffix(".")
    return in_one_line(error, root)
