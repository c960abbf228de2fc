"""pytest run within a command to judge claims: all of them, whatever the settings of other runs of pytest say."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import Final

import pytest

from evoclaims.claims import collected
from evoclaims.claims.claim import claim_of
from evoclaims.core.errors import UserError
from evoclaims.core.raised import in_one_line
from evoclaims.plugin.summary import ATTRIBUTE
from evoclaims.verdicts import history
from evoclaims.verdicts.claim_report import ClaimReport

_ENVIRONMENT: Final = ("PYTEST_ADDOPTS", "PYTEST_PLUGINS", "PYTEST_DISABLE_PLUGIN_AUTOLOAD")
"""Variables that change which tests a run of pytest collects, and when it stops."""

_ALONE: Final = (
    "-pevoclaims",
    "-pno:claims-summary",
    "-pno:terminal",
    "-pno:cacheprovider",
    "-pno:xdist",
    "-orequired_plugins=",  # one of them may be what was just left out
    # this process has imported evoclaims before pytest could look at its asserts
    "-Wignore::pytest.PytestAssertRewriteWarning",
)
MOST_NAMES: Final = 3
"""Most names of tests that an error lists."""


def judge(claims: Path, root: Path, tier: str, options: Sequence[str]) -> list[ClaimReport]:
    """Return the reports of all of a tier's claims.

    Options in the project's settings (addopts) and in the environment have no say in which claims are judged.

    Args:
        claims: folder of claim tests.
        root: of the project.
        tier: "smoke" or "full".
        options: further ones for pytest, such as "--claims-stored".

    Raises:
        UserError: when the claims cannot be collected, or something keeps one from being judged.
        KeyboardInterrupt: when the run is interrupted.
    """
    run = _Run((str(claims), f"--rootdir={root}", f"--claims-tier={tier}", *options, *_ALONE), root, tier)
    said = io.StringIO()
    with contextlib.redirect_stderr(said), _without(_ENVIRONMENT):
        try:
            status = pytest.main([*run.arguments], plugins=[run])
        except (Exception, SystemExit) as error:  # of a plugin that does not import, say
            run.troubles.append(_told(error, root))
            status = pytest.ExitCode.INTERNAL_ERROR
    if run.interrupted:
        raise KeyboardInterrupt
    if not run.troubles and status in (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.INTERNAL_ERROR):
        run.troubles.append(" ".join(said.getvalue().split()).removeprefix("ERROR: ").removesuffix("."))
    if run.troubles:
        rest = f", and {len(run.troubles) - 1} more such errors" if len(run.troubles) > 1 else ""
        raise UserError(f"The claims in {claims} cannot be collected: {run.troubles[0]}{rest}.")
    run.check_complete()
    return run.reports


class _Run:
    """A pytest plugin that takes no options from outside, and keeps what became of the claims."""

    def __init__(self, arguments: tuple[str, ...], root: Path, tier: str) -> None:
        """Start empty."""
        self.arguments = arguments
        self.reports: list[ClaimReport] = []
        self.troubles: list[str] = []
        self.interrupted = False
        self._root = root
        self._tier = tier
        self._collected: list[pytest.Item] = []

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_load_initial_conftests(
        self, early_config: pytest.Config, args: list[str]
    ) -> Generator[None, object, object]:
        """Leave out all arguments but our own, except how files are imported; plugins are loaded by now."""
        try:
            return (yield)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a conftest.py may raise SystemExit as well
            self.troubles.append(_told(error.__cause__ or error, self._root))
            raise pytest.UsageError from error
        finally:
            args[:] = [*self.arguments, f"--import-mode={early_config.known_args_namespace.importmode}"]

    def pytest_exception_interact(
        self, node: pytest.Item | pytest.Collector, call: pytest.CallInfo[object], report: object
    ) -> None:
        """Keep what broke a file of claims."""
        if isinstance(report, pytest.CollectReport) and call.excinfo is not None:
            self.troubles.append(_told(call.excinfo.value, self._root))

    def pytest_internalerror(self, excinfo: pytest.ExceptionInfo[BaseException]) -> bool:
        """Keep what a plugin or a conftest.py has raised, and have nothing printed of it."""
        self.troubles.append(_told(excinfo.value, self._root))
        return True

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        """Tell the user's Ctrl-C from pytest.exit(...), and from what pytest itself ends a run with."""
        self.interrupted = excinfo.type is KeyboardInterrupt

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        """Note a claim before anything can leave it out."""
        if claim_of(item) is not None:
            self._collected.append(item)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what became of a claim."""
        plain = getattr(report, ATTRIBUTE, None)
        if plain is not None:
            self.reports.append(ClaimReport.from_json(plain))

    def check_complete(self) -> None:
        """Refuse to speak for claims that were collected and have no report.

        Raises:
            UserError: when there are some.
        """
        judged = {history.key_of(report) for report in self.reports}
        wanted = [item for item in self._collected if collected.tier_of(item) == self._tier]
        left = [item.nodeid for item in wanted if collected.key_of(item) not in judged]
        if left:
            listed = ", ".join(left[:MOST_NAMES]) + (" and others" if len(left) > MOST_NAMES else "")
            raise UserError(
                f"{len(left)} of {len(wanted)} claims of the {self._tier} tier were collected and not judged "
                f"({listed}), since a plugin, a conftest.py or pytest.exit() left them out: a claim that is not to be "
                "judged has the mark pytest.mark.skip."
            )


def _told(error: BaseException, root: Path) -> str:
    """Return in one line what kept claims from being collected."""
    if isinstance(error, pytest.Collector.CollectError | pytest.UsageError | pytest.fail.Exception):
        cause = error.__cause__
        if isinstance(cause, ImportError | SyntaxError) and cause.msg:  # pytest's words are their traceback
            return in_one_line(cause, root)
        return " ".join(str(error).split()).removesuffix(".")
    return in_one_line(error, root)


@contextlib.contextmanager
def _without(names: Sequence[str]) -> Iterator[None]:
    """Run without some environment variables."""
    kept = {name: os.environ.pop(name) for name in names if name in os.environ}
    try:
        yield
    finally:
        os.environ.update(kept)
