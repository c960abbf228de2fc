"""Claims whose tests a plugin keeps from being run or reported: pytest itself would miss nothing.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

from collections.abc import Generator

import pytest

from evoclaims.plugin.summary import ATTRIBUTE, TROUBLE, Summary


class Untold:
    """Sees to it that each claim's test that is due ends with a report; an xdist worker has one of its own."""

    def __init__(self, config: pytest.Config) -> None:
        """Start empty."""
        self._config = config
        self._told: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note that a test has a claim's report, or fails, as where the process died that a plugin gave to it."""
        if getattr(report, ATTRIBUTE, None) is not None or report.failed:
            self._told.add(report.nodeid)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Report a claim without one; an interrupt passes, and a plan of fixtures judges nothing."""
        try:
            result = yield
        except pytest.exit.Exception as error:
            claims = [one.nodeid for one in item.session.items if one.get_closest_marker("claim") is not None]
            if error.returncode == 0 and (lost := [name for name in claims if name not in self._told]):
                self._say(f"pytest.exit(returncode=0) has ended the run before claims had verdicts: {', '.join(lost)}.")
            raise
        planned = any(self._config.getoption(name, False) for name in ("setuponly", "setupplan"))
        if item.get_closest_marker("claim") is not None and item.nodeid not in self._told and not planned:
            self._say(
                "A conftest.py or a plugin has kept claims from being judged or reported, without a word: "
                f"{item.nodeid}. To skip a claim, use pytest.mark.skip."
            )
        return result

    def _say(self, sentence: str) -> None:
        summary: Summary | None = self._config.pluginmanager.get_plugin("claims-summary")
        output = getattr(self._config, "workeroutput", None)
        if output is not None:
            output[TROUBLE] = " ".join(filter(None, (output.get(TROUBLE), sentence)))
        elif summary is not None:
            summary.report_trouble(sentence)
