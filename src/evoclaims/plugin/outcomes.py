"""A claim's verdict as its test's outcome: one report for each claim, in the place of passed and failed.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest

from evoclaims.core.errors import UserError, is_in_project
from evoclaims.core.printable import shown
from evoclaims.plugin.options import make_session
from evoclaims.plugin.summary import ATTRIBUTE

if TYPE_CHECKING:
    from evoclaims.claims.verdict_fixture import VerdictFixture
    from evoclaims.verdicts.claim_report import ClaimReport


def shortened(excinfo: pytest.ExceptionInfo[BaseException], item: pytest.Item) -> Any:
    """Return how pytest shows an exception, without the frames of other files before the project's last one.

    None where only one of the project's files, the claim's, is among the frames: the error may be of evoclaims, and all
    that pytest shows stays. So it does with --full-trace, and without pytest's terminal, which defines how it is shown.
    """
    if not item.config.pluginmanager.has_plugin("terminal"):
        return None
    root, style = item.config.rootpath, item.config.getoption("tbstyle")
    files = {entry.path for entry in excinfo.traceback if is_in_project(Path(entry.path), root)}
    if item.config.getoption("fulltrace") or len(files) < 2:
        return None

    def kept(info: pytest.ExceptionInfo[BaseException]) -> Any:
        """Return the frames to show, also of an exception that caused this one."""
        entries = list(info.traceback)
        of_project = [place for place, entry in enumerate(entries) if is_in_project(Path(entry.path), root)]
        last = of_project[-1] if of_project else 0
        shown = {id(entry) for place, entry in enumerate(entries) if place in of_project or place >= last}
        return info.traceback.filter(lambda entry: id(entry) in shown)

    showlocals = item.config.getoption("showlocals")
    return excinfo.getrepr(style="long" if style == "auto" else style, showlocals=showlocals, tbfilter=kept)


P_NAMES: Final = {"for": "p", "against": "p_refuted", "against its size": "p_smaller"}
"""Names of the p that decides, as in the tables of `evoclaims status`, by its direction."""

_SKIPPING: Final = (pytest.skip.Exception, pytest.xfail.Exception)

VERDICTS: pytest.StashKey[VerdictFixture] = pytest.StashKey()
"""Under which a claim's test keeps what its fixture `verdict` has judged."""


@dataclass
class _State:
    """How far one run of a claim's test is; a plugin may run it several times.

    Attributes:
        called: whether the test's function has ended.
        raised: what it has raised.
        claimed: the claim's report of this run as JSON; None if it has none yet.
    """

    called: bool = False
    raised: pytest.ExceptionInfo[BaseException] | None = None
    claimed: dict[str, Any] | None = None


_state: pytest.StashKey[_State] = pytest.StashKey()
_runs: pytest.StashKey[dict[tuple[str, str], ClaimReport]] = pytest.StashKey()
"""The newest report of each claim, by tier and name: a plugin may run its test again."""


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a claim that has no test at its tier; a claim may be run several times."""
    item.stash[_state] = _State()
    because = _gap(item)
    if because:
        pytest.skip(because)


def _gap(item: pytest.Item) -> str:
    """Return why a claim has no test at its tier; empty if it has one, or is no claim."""
    if item.get_closest_marker("claim_without_smoke") is None:
        return ""
    from evoclaims.claims.claim import ClaimTest, gap_of

    return gap_of(item, ClaimTest.of(item).tier)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, None, None]:
    """Note how a claim's test has ended: what is reported before is of a part of it."""
    state = item.stash[_state] = _State()  # a plugin may call it again without setting it up again
    if VERDICTS in item.stash:
        item.stash[VERDICTS].report = None
    try:
        return (yield)
    except BaseException as error:
        state.raised = pytest.ExceptionInfo.from_exception(error)
        raise
    finally:
        state.called = True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Turn a claim's report into the test's outcome, without a traceback."""
    report = yield
    if item.get_closest_marker("claim") is None:
        return report
    state = item.stash.setdefault(_state, _State())  # another plugin may have kept it from being set up
    if report.when == "teardown":
        _add_to_teardown(item, call, report, state)
        return report
    if report.when == "setup" and report.passed:
        return report
    if call.excinfo and call.excinfo.errisinstance(KeyboardInterrupt):
        return report
    if report.when == "call" and not state.called:  # of a part of the test, by pytest's fixture subtests
        return report
    claimed = _claim_report(item, call.excinfo, report)
    state.claimed = claimed.to_json()
    setattr(report, ATTRIBUTE, state.claimed)
    if not report.skipped or claimed.outcome != "not run":
        _give_outcome(item, call.excinfo, report, claimed)
    return report


def _add_to_teardown(item: pytest.Item, call: pytest.CallInfo[None], report: pytest.TestReport, state: _State) -> None:
    """Let the last report of a run carry the claim's report, too: plugins that run tests again hide other reports.

    `flaky` does not log the report of a failed call. pytest-retry calls a test again and makes no report of that.
    """
    if state.claimed is None:
        excinfo = call.excinfo or state.raised
        ran_again = state.called and not (excinfo and excinfo.errisinstance(KeyboardInterrupt))
        if report.skipped or not (report.failed or ran_again):
            return
        claimed = _claim_report(item, excinfo, report)
        state.claimed = claimed.to_json()
        if claimed.outcome != "not run":
            _give_outcome(item, excinfo, report, claimed)
    setattr(report, ATTRIBUTE, state.claimed)


def _give_outcome(
    item: pytest.Item,
    excinfo: pytest.ExceptionInfo[BaseException] | None,
    report: pytest.TestReport,
    claimed: ClaimReport,
) -> None:
    vars(report).pop("wasxfail", None)  # only expect=... accepts a verdict, and no mark of pytest's
    sentence = f"{claimed.name} ({claimed.tier}) is {claimed.outcome}: {claimed.reason}"
    undecided = claimed.outcome == "inconclusive" and item.config.getoption("claims_undecided") == "fail"
    failed = claimed.failed or (undecided and not claimed.as_expected)
    # By pytest itself: what xfail(strict=True) expects to fail has not, or a part of the test has.
    failed_by_pytest = report.failed and not (excinfo or failed)
    # A test whose setup passed would be called without its fixtures; and without trials nothing has passed.
    unjudged = claimed.outcome == "not run" and not report.failed
    if (report.when == "setup" or unjudged) and not failed:
        report.outcome, report.longrepr = "skipped", (item.location[0], item.location[1] or 0, sentence)
    elif not failed_by_pytest:
        report.outcome = "failed" if failed else "passed"
        if excinfo is None or excinfo.errisinstance((UserError, *_SKIPPING)):
            report.longrepr = shown(sentence) if failed else None
        else:
            report.longrepr = shortened(excinfo, item) or report.longrepr
    properties: list[tuple[str, object]] = [
        ("claim", claimed.claim),
        ("tier", claimed.tier),
        ("verdict", str(claimed.outcome)),
        ("reason", claimed.reason),
        ("n", claimed.n),
        ("evidence", claimed.evidence),
    ]
    decision = claimed.verdict.decision if claimed.verdict else None
    if decision is not None:
        properties.append((P_NAMES[decision.direction], decision.p))
    for kept in (item.user_properties, report.user_properties):  # JUnit's file takes those of the teardown's report
        names = {*dict(properties), *P_NAMES.values()}
        kept[:] = [one for one in kept if one[0] not in names] + properties  # in place of an earlier run's


def _claim_report(
    item: pytest.Item, excinfo: pytest.ExceptionInfo[BaseException] | None, report: pytest.TestReport
) -> ClaimReport:
    """Return the report of a claim test: its verdict, the error that prevented one, or why it was skipped."""
    from evoclaims.claims.claim import ClaimTest, expectation_of
    from evoclaims.claims.report_making import broken, unjudged
    from evoclaims.judging.verdict import Outcome
    from evoclaims.verdicts.history import key_of

    test, verdicts, session = ClaimTest.of(item), item.stash.get(VERDICTS, None), make_session(item.config)
    if because := _gap(item):
        reason = f"it has no {test.tier} test: {because}"
        return session.skipped(unjudged(test, Outcome.NOT_RUN, reason, has_test=False))
    judged = item.stash[_state].called and verdicts is not None and verdicts.report is not None
    if report.skipped and not judged:  # or failed as an xfail mark expects
        sentence = (
            report.longrepr[2] if isinstance(report.longrepr, tuple) else f"xfail: {getattr(report, 'wasxfail', '')}"
        )
        why = sentence.removeprefix("Skipped: ") or "no reason given"
        return session.skipped(unjudged(test, Outcome.NOT_RUN, f"its test was skipped ({why})"))
    if excinfo is not None and excinfo.errisinstance(pytest.skip.Exception) and not judged:
        return session.skipped(unjudged(test, Outcome.NOT_RUN, f"its test was skipped ({excinfo.value})"))
    if excinfo is not None and isinstance(excinfo.value, pytest.FixtureLookupError) and excinfo.value.argname:
        lacking = f"There is no fixture named {excinfo.value.argname!r}: a claim takes trials and verdict."
        claimed = unjudged(test, Outcome.ERROR, lacking)
    elif excinfo is not None and judged and excinfo.errisinstance(_SKIPPING):
        late = f"the test was skipped ({excinfo.value}) after verdict(...), which this would hide: skip it before"
        claimed = unjudged(test, Outcome.ERROR, late)
    elif excinfo is not None:
        claimed = broken(test, excinfo.value, item.config.rootpath)
    elif verdicts is None or verdicts.report is None:
        claimed = unjudged(test, Outcome.ERROR, "the test ended without calling verdict(...), so it judged nothing")
    else:
        claimed = verdicts.report
    runs = item.config.stash.setdefault(_runs, {})
    complete = session.complete(claimed, expectation_of(item, test.tier), runs.get(key_of(claimed)))
    runs[key_of(complete)] = complete
    return complete


def pytest_report_teststatus(
    report: pytest.CollectReport | pytest.TestReport, config: pytest.Config
) -> tuple[str, str, str | tuple[str, dict[str, bool]]] | None:
    """Show a claim's verdict in place of passed and failed."""
    plain = getattr(report, ATTRIBUTE, None)
    if plain is None or report.outcome not in ("passed", "failed", "skipped"):  # "rerun" has a word of its plugin
        return None
    if report.when == "teardown" and report.passed:  # the claim's outcome is shown already
        return None
    from evoclaims.judging.verdict import Outcome
    from evoclaims.verdicts.claim_report import ClaimReport

    claimed = ClaimReport.from_json(plain)
    outcome = claimed.outcome
    if claimed.failed and report.passed:  # a plugin has run the test again, and the next report has that outcome
        return None
    failed_by_pytest = report.failed and (claimed.as_expected or outcome == Outcome.SUPPORTED)
    if outcome == Outcome.NOT_RUN or failed_by_pytest:  # in pytest's own words
        return None
    words = f"{outcome} (accepted)" if claimed.as_expected else str(outcome)
    colour = {"red": True} if report.failed else {"green": True} if outcome == Outcome.SUPPORTED else {"yellow": True}
    return words, outcome.symbol, (words.upper(), colour)
