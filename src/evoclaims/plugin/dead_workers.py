"""One sentence where pytest-xdist's workers die while they start, instead of its own traceback."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Callable, Generator
from traceback import clear_frames
from typing import Any, Final

import pytest

from evoclaims.core.errors import UserError

KEYBOARD: Final = "keyboard-interrupt"
"""What xdist reports of a worker that Ctrl-C has ended."""


class DeadWorkers:
    """Watches, in the controller of a project with claims, which workers end before they have collected."""

    def __init__(self, config: pytest.Config, report: Callable[[str], None]) -> None:
        """Start empty; `report` takes the sentence."""
        self._config = config
        self._report = report
        self._collected: set[str] = set()
        self._dead: dict[str, str] = {}
        self._ran = False

    def pytest_runtest_logstart(self) -> None:
        """Note that a test has begun."""
        self._ran = True

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node: Any) -> None:
        """Note that a worker has started."""
        self._collected.add(node.gateway.id)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object) -> None:
        """Note that a worker has died; `error` is None for one that has ended by itself."""
        if getattr(node, "workeroutput", {}).get("exitstatus") == pytest.ExitCode.INTERNAL_ERROR:
            self._dead[node.gateway.id] = "internal error"
        elif error not in (None, KEYBOARD) and node.gateway.id not in self._collected:
            self._dead[node.gateway.id] = str(error).strip().rpartition("\n")[2]

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_sessionstart(self) -> Generator[None, object, object]:
        """Refuse the run where a worker's process does not start at all."""
        try:
            return (yield)
        except (EOFError, OSError) as error:
            if not self._config.pluginmanager.has_plugin("dsession") or not self._has_claims():
                raise
            why = f"{type(error).__name__}: {error}"
            with warnings.catch_warnings(action="ignore"):  # of the pipes that the dead process leaves open
                clear_frames(error.__traceback__)
                gc.collect()
        raise pytest.UsageError(_sentence("A worker", why))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtestloop(self) -> Generator[None, object, object]:
        """Report dead workers where none has run anything, whatever xdist makes of them."""
        try:
            return (yield)
        except (AssertionError, KeyError, RuntimeError):  # xdist's own bookkeeping fails without workers
            if not self._dead or self._ran or not self._has_claims():
                raise
            return True
        finally:
            if self._dead and not self._ran and self._has_claims():
                names = f"{'Workers' if len(self._dead) > 1 else 'The worker'} {', '.join(sorted(self._dead))}"
                self._report(_sentence(names, min(self._dead.values())))

    def _has_claims(self) -> bool:
        from evoclaims.paper.config import find_root

        try:
            find_root(self._config.rootpath)
        except UserError:
            return False
        return True


def _sentence(who: str, why: str) -> str:
    return (
        f"{who} of pytest-xdist died while starting, so that no test has run ({why}). A worker was killed, found no "
        "memory, or cannot load a plugin or conftest.py: use fewer workers (-n 1), or leave out -n to see the error."
    )
