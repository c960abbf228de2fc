"""The pytest plugin: claims as tests, tiers as markers, verdicts as outcomes.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.core.printable import shown
from evoclaims.core.raised import in_one_line
from evoclaims.core.tiers import TIERS
from evoclaims.plugin import options
from evoclaims.plugin.distribution import Distribution, prepare
from evoclaims.plugin.options import pytest_addoption as pytest_addoption
from evoclaims.plugin.overlooked import pytest_pycollect_makeitem as pytest_pycollect_makeitem
from evoclaims.plugin.own_gpu import pytest_load_initial_conftests as pytest_load_initial_conftests
from evoclaims.plugin.own_gpu import pytest_xdist_auto_num_workers as pytest_xdist_auto_num_workers
from evoclaims.plugin.progress import QUIET, ProgressLine, progress_of
from evoclaims.plugin.run_session import import_from_root, make_session
from evoclaims.plugin.summary import ATTRIBUTE, KNOWN, TROUBLE, Summary
from evoclaims.plugin.tracebacks import shortened
from evoclaims.trials.allowance import end_without
from evoclaims.trials.stopping import interrupted_by

if TYPE_CHECKING:
    from evoclaims.claims.collected import ClaimTest
    from evoclaims.claims.session import Verdicts
    from evoclaims.paper.trial_group import TrialGroup
    from evoclaims.verdicts.claim_report import ClaimReport

_verdicts: pytest.StashKey[Verdicts] = pytest.StashKey()
_reported: pytest.StashKey[bool] = pytest.StashKey()
_ended: pytest.StashKey[pytest.Session] = pytest.StashKey()


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers."""
    for line in (
        "smoke: claims at reduced budgets",
        "full: claims at the paper's budgets; only run when asked for",
        "claim(claim): the claim that a test checks (set by @claim)",
        "claim_expect(expectation): an accepted outcome (set by expected(...))",
        "claim_without_smoke(because): no smoke test (set by smoke=None and without_smoke(...))",
    ):
        config.addinivalue_line("markers", line)
    if not hasattr(config, "workerinput"):  # an xdist worker leaves the summary to its controller
        config.pluginmanager.register(Summary(config), "claims-summary")
        config.pluginmanager.register(Distribution(config), "claims-distribution")
        if config.pluginmanager.has_plugin("terminal") and config.get_verbosity() > QUIET:
            config.pluginmanager.register(ProgressLine(config), "claims-progress")
    options.check(config)
    import_from_root(config)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_generate_tests(metafunc: pytest.Metafunc) -> Generator[None, object, object]:
    """Run each claim once per tier; a test ends with both, after all other parameters: test_x[n_parity-G1-smoke]."""
    made = yield
    if metafunc.definition.get_closest_marker("claim") is not None:
        if "claim_tier" not in metafunc.fixturenames:
            raise pytest.UsageError(
                f"{metafunc.definition.nodeid} is a claim but takes neither the fixture `trials` nor `verdict`."
            )
        from evoclaims.claims.claim import claim_of
        from evoclaims.claims.collected import tier_id

        claim = claim_of(metafunc.definition)
        metafunc.parametrize(
            "claim_tier",
            [pytest.param(tier, marks=getattr(pytest.mark, tier), id=tier_id(claim, tier)) for tier in TIERS],
        )
    return made


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(session: pytest.Session, config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out other tiers and claims; the full tier is only kept when it was asked for by name."""
    tests: dict[pytest.Item, ClaimTest] = {}
    try:
        if any(item.get_closest_marker("claim") for item in items):
            from evoclaims.claims.collected import claim_tests

            tests = claim_tests(items)
        config.stash[KNOWN] = {test.claim.id for test in tests.values()}
        wanted = options.wanted_claims(config, tests.values(), incomplete=session.testsfailed > 0)
    except UserError as error:
        _refuse(config, items, error)
        return
    tiers = options.wanted_tiers(config)
    dropped = [
        item
        for item, test in tests.items()
        if wanted.isdisjoint((test.claim.id, test.key[1])) or test.tier not in tiers
    ]
    if dropped:
        config.hook.pytest_deselected(items=dropped)
        items[:] = [item for item in items if item not in set(dropped)]


def _refuse(config: pytest.Config, items: list[pytest.Item], error: UserError) -> None:
    """End the run with a sentence; an xdist worker only passes it on to its controller. Nothing runs."""
    items.clear()  # pytest goes on to `pytest_collection_finish`
    output: dict[str, Any] | None = getattr(config, "workeroutput", None)
    if output is None:
        raise pytest.UsageError(str(error)) from error
    output[TROUBLE] = str(error)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_finish(session: pytest.Session) -> None:
    """Check before the first trial that claims can be judged, and put them in order."""
    config = session.config
    if not any(item.get_closest_marker("claim") for item in session.items) or config.option.collectonly:
        return
    from evoclaims.claims.collected import claim_tests

    try:
        prepare(session, make_session(config), claim_tests(session.items))
    except UserError as error:
        _refuse(config, session.items, error)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> Generator[None, object, object]:
    """While claims run, let Ctrl-C interrupt them wherever they are (see `interrupted_by`)."""
    if not any(item.get_closest_marker("claim") for item in session.items):
        return (yield)
    with interrupted_by(signal.SIGINT):
        return (yield)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Keep the session, which knows the exit status, for `pytest_unconfigure`."""
    session.config.stash[_ended] = session


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """End the process if trials that did not return in time still run in it."""
    if _ended in config.stash:
        end_without(int(config.stash[_ended].exitstatus))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a claim that has no test at its tier."""
    because = _gap(item)
    if because:
        pytest.skip(because)


def _gap(item: pytest.Item) -> str:
    """Return why a claim has no test at its tier; empty if it has one, or is no claim."""
    if item.get_closest_marker("claim_without_smoke") is None:
        return ""
    from evoclaims.claims.claim import gap_of
    from evoclaims.claims.collected import ClaimTest

    return gap_of(item, ClaimTest.of(item).tier)


@pytest.fixture
def claim_tier() -> str:
    """The tier that a claim is judged at; parametrized for every claim."""
    raise UserError("The fixtures `trials` and `verdict` are for tests marked with @claim(...).")


@pytest.fixture
def trials(request: pytest.FixtureRequest, claim_tier: str) -> Callable[..., TrialGroup]:
    """Return `trials(method, on=task)`: a condition's trials, run when a verdict needs them."""
    session = make_session(request.config)

    def group(method: str, *rest: object, on: str | None = None) -> TrialGroup:
        if rest or on is None:
            task = repr(on or rest[0]) if on or rest else "task"
            raise UserError(
                f"trials({', '.join(map(repr, (method, *rest)))}) does not say on which task: write "
                f"trials({method!r}, on={task})."
            )
        return session.group(method, on, claim_tier)

    return group


@pytest.fixture
def verdict(request: pytest.FixtureRequest, claim_tier: str) -> Verdicts:
    """Return `verdict(assertion)`, which judges the claim."""
    from evoclaims.claims.collected import ClaimTest
    from evoclaims.claims.session import Verdicts

    session, test = make_session(request.config), ClaimTest.of(request.node)
    line = progress_of(request.config)

    def settle(assertion: Any) -> ClaimReport:
        try:
            return session.settle(test, assertion)
        finally:
            if line is not None:
                line.close()

    verdicts = request.node.stash[_verdicts] = Verdicts(settle)
    return verdicts


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Turn a claim's report into the test's outcome, without a traceback."""
    report = yield
    if item.get_closest_marker("claim") is None or (report.when != "call" and report.passed):
        return report
    if call.excinfo and call.excinfo.errisinstance(KeyboardInterrupt):
        return report
    if report.when == "teardown" and (report.skipped or _reported in item.stash):  # one verdict a claim
        return report
    claimed = _claim_report(item, call, report)
    setattr(report, ATTRIBUTE, claimed.to_json())
    item.stash[_reported] = True
    if report.skipped:
        return report
    undecided = claimed.outcome == "inconclusive" and item.config.getoption("claims_undecided") == "fail"
    failed = claimed.failed or (undecided and not claimed.as_expected)
    report.outcome = "failed" if failed else "passed"
    expected_failure = call.excinfo is None or call.excinfo.errisinstance(UserError)
    if expected_failure:
        said = f"{claimed.name} ({claimed.tier}) is {claimed.outcome}: {claimed.reason}"
        report.longrepr = shown(said) if failed else None
    elif call.excinfo:
        report.longrepr = shortened(call.excinfo, item) or report.longrepr
    properties: list[tuple[str, object]] = [
        ("claim", claimed.claim),
        ("tier", claimed.tier),
        ("verdict", str(claimed.outcome)),
        ("reason", claimed.reason),
        ("n", claimed.n),
        ("p", claimed.p),
        ("evidence", claimed.evidence),
    ]
    item.user_properties += properties  # JUnit's file takes them from the report of the teardown
    report.user_properties += properties
    return report


def _claim_report(item: pytest.Item, call: pytest.CallInfo[None], report: pytest.TestReport) -> ClaimReport:
    """Return the report of a claim test: its verdict, the error that prevented one, or why it was skipped."""
    from evoclaims.claims.claim import expectation_of
    from evoclaims.claims.collected import ClaimTest
    from evoclaims.claims.reporting import unjudged
    from evoclaims.judging.verdict import Outcome

    test, verdicts = ClaimTest.of(item), item.stash.get(_verdicts, None)
    if because := _gap(item):
        return unjudged(test, Outcome.NOT_RUN, f"it has no {test.tier} test: {because}", has_test=False)
    if report.skipped:  # or failed as an xfail mark expects
        said = report.longrepr[2] if isinstance(report.longrepr, tuple) else f"xfail: {getattr(report, 'wasxfail', '')}"
        why = said.removeprefix("Skipped: ") or "no reason given"
        return unjudged(test, Outcome.NOT_RUN, f"its test was skipped ({why})")
    if call.excinfo is not None:
        claimed = unjudged(test, Outcome.ERROR, _sentence(call.excinfo, item.config.rootpath))
    elif verdicts is None or verdicts.report is None:
        claimed = unjudged(test, Outcome.ERROR, "the test ended without calling verdict(...), so it judged nothing")
    else:
        claimed = verdicts.report
    return make_session(item.config).complete(claimed, expectation_of(item, test.tier))


def _sentence(excinfo: pytest.ExceptionInfo[BaseException], root: Path) -> str:
    """Return an exception as one line, with its place in the project `root` if it is none of evoclaims' own."""
    if isinstance(excinfo.value, pytest.FixtureLookupError) and excinfo.value.argname:
        return f"There is no fixture named {excinfo.value.argname!r}: a claim takes trials and verdict."
    text = str(excinfo.value).strip().splitlines()
    return text[0] if text and excinfo.errisinstance(UserError) else in_one_line(excinfo.value, root)


def pytest_report_teststatus(
    report: pytest.CollectReport | pytest.TestReport, config: pytest.Config
) -> tuple[str, str, str | tuple[str, dict[str, bool]]] | None:
    """Show a claim's verdict in place of passed and failed."""
    plain = getattr(report, ATTRIBUTE, None)
    if plain is None or report.skipped:
        return None
    from evoclaims.judging.verdict import Outcome
    from evoclaims.verdicts.claim_report import ClaimReport

    claimed = ClaimReport.from_json(plain)
    outcome = claimed.outcome
    words = f"{outcome} (accepted)" if claimed.as_expected else str(outcome)
    colour = {"red": True} if report.failed else {"green": True} if outcome == Outcome.SUPPORTED else {"yellow": True}
    return words, outcome.symbol, (words.upper(), colour)
