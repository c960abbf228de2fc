"""The progress line of a run of claims, but for one by xdist's workers.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import threading
from collections.abc import Generator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any, Final

import pytest

if TYPE_CHECKING:
    from evoclaims.claims.workload import Watching, Workload
    from evoclaims.report.live_line import LiveLine
    from evoclaims.trials.progress import RunProgress

TICK_SECONDS: Final = 0.5
"""Time between two looks at what other processes run."""

QUIET: Final = -2
"""From this verbosity on (-qq), no progress is shown."""


def progress_of(config: pytest.Config) -> ProgressLine | None:
    """Return the progress line of a run; None if it shows none, as under xdist."""
    return config.pluginmanager.get_plugin("claims-progress")


class ProgressLine:
    """Shows how far the claims of a run are, between the results of its tests."""

    def __init__(self, config: pytest.Config) -> None:
        """Show nothing yet."""
        self._config = config
        self._line: LiveLine | None = None
        self._watching: Watching | None = None
        self._lock = threading.RLock()
        self._stopped = threading.Event()
        self._ticking: threading.Thread | None = None

    def begin(self, load: Workload, workers: int, tick: bool) -> None:
        """Begin to show how far a run is; with `tick`, now and then by itself, else whenever a run reports something.

        A run that takes hours on a processor is announced beforehand.
        """
        from evoclaims.claims.workload import Watching
        from evoclaims.report.live_line import beforehand

        if notice := beforehand(load):
            self._write(f"\n{notice}\n")
        self._watching = Watching(load, workers)
        if tick and self._ticking is None:
            self._ticking = threading.Thread(target=self._tick, daemon=True)
            self._ticking.start()

    def __call__(self, progress: RunProgress) -> None:
        """Show the newest state of a run in this process: a watcher of it."""
        from evoclaims.report.live_line import describe, describe_all

        def text() -> str:
            seen = self._watching.look() if self._watching else None
            return describe_all(seen) if seen and seen.running and not progress.remark else describe(progress)

        with self._lock:
            self._made().show(text, progress.remark)

    def remark(self, text: str) -> None:
        """Say something on a line of its own."""
        with self._lock:
            self.close()
            self._write(f"\nevoclaims: {text}\n")

    def close(self) -> None:
        """Leave the line, so that other output starts on a fresh one."""
        with self._lock:
            if self._line is not None:
                self._line.close()

    def _made(self) -> LiveLine:
        if self._line is None:
            from evoclaims.report.live_line import LiveLine

            writer = self._config.get_terminal_writer()
            self._line = LiveLine(self._write, writer.fullwidth if writer.hasmarkup else None)
        return self._line

    def _write(self, text: str) -> None:
        """Write past pytest's capture, while trials run."""
        capture: Any = self._config.pluginmanager.get_plugin("capturemanager")
        with capture.global_and_fixture_disabled() if capture else nullcontext():
            self._config.get_terminal_writer().write(text, flush=True)

    def _tick(self) -> None:
        """Show what other processes do, until the run ends."""
        from evoclaims.report.live_line import describe_all

        def text() -> str:
            seen = self._watching.look() if self._watching else None
            return describe_all(seen) if seen and seen.running else ""

        while not self._stopped.wait(TICK_SECONDS):
            with self._lock:
                if not self._stopped.is_set():
                    self._made().show(text)

    @contextmanager
    def _aside(self) -> Generator[None]:
        """Keep the line away while pytest writes."""
        with self._lock:
            self.close()
            yield

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_logstart(self) -> Generator[None, Any, Any]:
        """Make room for what pytest writes."""
        with self._aside():
            return (yield)

    pytest_runtest_logfinish = pytest_runtest_logstart

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> Generator[None, Any, Any]:
        """Make room for what pytest writes, and count a claim that has been judged."""
        with self._aside():
            if self._watching is not None and (report.when == "call" or not report.passed):
                self._watching.judged(report.nodeid)
            return (yield)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self) -> None:
        """Show nothing more."""
        self._stopped.set()
        self.close()
        if self._ticking is not None:
            self._ticking.join()
