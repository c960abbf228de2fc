"""The pytest plugin: claims as tests, and tiers as markers; verdicts become outcomes in `outcomes`.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.core.tiers import TIERS
from evoclaims.execution.host import gpus, host_of
from evoclaims.plugin import options
from evoclaims.plugin.collection import pytest_collect_file as pytest_collect_file
from evoclaims.plugin.collection import pytest_pycollect_makeitem as pytest_pycollect_makeitem
from evoclaims.plugin.options import AHEAD, import_from_root, make_session
from evoclaims.plugin.options import pytest_addoption as pytest_addoption
from evoclaims.plugin.outcomes import VERDICTS
from evoclaims.plugin.outcomes import pytest_report_teststatus as pytest_report_teststatus
from evoclaims.plugin.outcomes import pytest_runtest_call as pytest_runtest_call
from evoclaims.plugin.outcomes import pytest_runtest_makereport as pytest_runtest_makereport
from evoclaims.plugin.outcomes import pytest_runtest_setup as pytest_runtest_setup
from evoclaims.plugin.progress import QUIET, ProgressLine, progress_of
from evoclaims.plugin.start import prepare
from evoclaims.plugin.summary import COLLECTED, COLLECTED_THERE, KNOWN, TROUBLE, Summary
from evoclaims.plugin.untold import Untold
from evoclaims.trials.stopping import end_without, interrupted_by, only_told

if TYPE_CHECKING:
    from evoclaims.claims.claim import ClaimTest
    from evoclaims.claims.verdict_fixture import VerdictFixture
    from evoclaims.paper.trial_group import TrialGroup
    from evoclaims.verdicts.claim_report import ClaimReport


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config) -> None:
    """Keep this process off GPUs that are for others, before anything can make an array; options are parsed."""
    known = early_config.known_args_namespace
    # Other projects that have evoclaims installed are left alone.
    if known.claims_processes != "1" and gpus(known.claims_device) and options.settings_of(early_config):
        with suppress(UserError):  # `options.check` reports it
            host_of(known.claims_processes, known.claims_device)


_ended: pytest.StashKey[pytest.Session] = pytest.StashKey()


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers."""
    for line in (
        "smoke: claims at reduced budgets",
        "full: claims at the paper's budgets; only run when asked for",
        "claim(claim): the claim that a test checks (set by @claim)",
        "claim_expect(expectation): an accepted outcome (set by expected(...))",
        "claim_repeated(names): parameters by which a plugin repeats a claim's test (set by evoclaims)",
        "claim_third_look: judged by thirty trials where ten leave it open (third_look)",
        "claim_without_smoke(because): no smoke test (set by smoke=None and without_smoke(...))",
    ):
        config.addinivalue_line("markers", line)
    config.pluginmanager.register(Untold(config), "claims-untold")
    if not hasattr(config, "workerinput"):  # an xdist worker leaves the summary to its controller
        config.pluginmanager.register(Summary(config), "claims-summary")
        if config.pluginmanager.has_plugin("terminal") and config.get_verbosity() > QUIET:
            config.pluginmanager.register(ProgressLine(config), "claims-progress")
    options.check(config)
    import_from_root(config)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_generate_tests(metafunc: pytest.Metafunc) -> Generator[None, object, object]:
    """Run each claim once per tier; a test ends with both, after all other parameters: test_x[n_parity-G1-smoke]."""
    if metafunc.definition.get_closest_marker("claim") is None:
        return (yield)
    from evoclaims.claims.claim import TIER, Smaller, claim_of, tier_id
    from evoclaims.claims.claim_names import note_repetitions

    repeats = note_repetitions(metafunc)
    made = yield
    if TIER not in metafunc.fixturenames:
        raise pytest.UsageError(
            f"{metafunc.definition.nodeid} is a claim but takes neither the fixture `trials` nor `verdict`."
        )
    claim, repeated = claim_of(metafunc.definition), [pytest.mark.claim_repeated(*repeats)] if repeats else []
    tiers = ("smoke",) if isinstance(claim, Smaller) else TIERS
    metafunc.parametrize(
        TIER,
        [pytest.param(tier, marks=[getattr(pytest.mark, tier), *repeated], id=tier_id(claim, tier)) for tier in tiers],
    )
    return made


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """While claims are collected and prepared, which imports jax, let Ctrl-C interrupt that."""
    if not options.names_us(session.config):
        return (yield)
    with _interrupted(session.config):
        return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(session: pytest.Session, config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out other tiers and claims; the full tier is only kept when it was asked for by name."""
    tests: dict[pytest.Item, ClaimTest] = {}
    try:
        if any(item.get_closest_marker("claim") for item in items):
            from evoclaims.claims.claim_names import claim_tests

            tests = claim_tests(items)
            options.check_project(config, tests)
        config.stash[KNOWN] = {test.claim.id for test in tests.values()}
        if _collects_all(session):
            config.stash[COLLECTED] = found = {test.key for test in tests.values()}
            getattr(config, "workeroutput", {})[COLLECTED_THERE] = sorted(found)
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
    config.stash[_kept] = {item for item in items if item in tests}


_kept: pytest.StashKey[set[pytest.Item]] = pytest.StashKey()
"""The claim tests that the options select, but for those that are deselected afterwards."""


def pytest_deselected(items: Sequence[pytest.Item]) -> None:
    """Note what pytest's own options, or a plugin, leave out openly."""
    for item in items:
        item.config.stash.get(_kept, set()).discard(item)


def _collects_all(session: pytest.Session) -> bool:
    """Whether a run has collected all files in the project's folder of claims."""
    config = session.config
    if session.testsfailed or any(config.getoption(name, None) for name in ("ignore", "ignore_glob", "lf")):
        return False
    settings = options.settings_of(config)
    if settings is None:
        return False
    claims = (config.rootpath / settings.claims).resolve()
    return any(claims.is_relative_to((config.invocation_params.dir / place).resolve()) for place in config.args)


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
    lost = sorted(item.nodeid for item in config.stash.get(_kept, set()).difference(session.items))
    if config.option.collectonly or not (lost or any(item.get_closest_marker("claim") for item in session.items)):
        return
    from evoclaims.claims.claim_names import claim_tests

    try:
        if lost:
            raise UserError(
                f"A conftest.py or a plugin has taken claims out of the run without a word: {', '.join(lost)}. Let it "
                "call config.hook.pytest_deselected(items=...), or choose claims by --claims-only."
            )
        prepare(session, claim_tests(session.items))
    except UserError as error:
        _refuse(config, session.items, error)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> Generator[None, object, object]:
    """While claims run, let Ctrl-C interrupt them wherever they are; afterwards the run ends, and nothing does."""
    if not any(item.get_closest_marker("claim") for item in session.items):
        return (yield)
    with _interrupted(session.config):
        try:
            return (yield)
        finally:
            session.config.stash[_is_ending] = True


_is_ending: pytest.StashKey[bool] = pytest.StashKey()
"""Whether a run has nothing more to do but to end: known as soon as Ctrl-C can interrupt something."""


@contextmanager
def _interrupted(config: pytest.Config) -> Iterator[None]:
    """Let Ctrl-C interrupt a `with` block wherever it is (see `interrupted_by`), and then nothing to the run's end.

    A second one would be a traceback, and the verdicts would be lost: it is answered.
    """
    reporter: Any = config.pluginmanager.get_plugin("terminalreporter")  # none in a worker of xdist

    def answer() -> None:
        if not config.stash[_is_ending]:
            raise KeyboardInterrupt
        text = "\nevoclaims: the run is ending; what has run is kept.\n"
        with suppress(AttributeError, OSError, ValueError):  # not by the writer: it may be in the middle of a line
            os.write(reporter._tw._file.fileno(), text.encode())

    if _is_ending not in config.stash:
        config.stash[_is_ending] = False
        until_the_end = ExitStack()
        until_the_end.enter_context(only_told(signal.SIGINT, answer))
        config.add_cleanup(until_the_end.close)
    with interrupted_by(signal.SIGINT):
        try:
            yield
        except KeyboardInterrupt:
            config.stash[_is_ending] = True
            raise


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """End the processes that run trials; keep the session, which knows the exit status, for `pytest_unconfigure`."""
    if AHEAD in session.config.stash:
        session.config.stash[AHEAD].stop()
    session.config.stash[_ended] = session


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """End the process if trials that did not return in time still run in it, unless a command goes on in it."""
    sessions = sys.modules.get("evoclaims.claims.session")  # not imported for other projects
    if _ended in config.stash and not (sessions and config.stash.get(sessions.WITHIN, False)):
        end_without(int(config.stash[_ended].exitstatus))


@pytest.fixture
def _claim_tier() -> str:
    """The tier that a claim is judged at; parametrized for every claim."""
    raise UserError("The fixtures `trials` and `verdict` are for tests marked with @claim(...).")


@pytest.fixture
def trials(request: pytest.FixtureRequest, _claim_tier: str) -> Callable[..., TrialGroup]:
    """Return `trials(method, on=task)`: a condition's trials, run when a verdict needs them."""
    session = make_session(request.config)

    def group(method: str, *rest: object, on: str | None = None) -> TrialGroup:
        if rest or on is None:
            task = repr(on or rest[0]) if on or rest else "task"
            raise UserError(
                f"trials({', '.join(map(repr, (method, *rest)))}) names no task. Write trials({method!r}, on={task})."
            )
        return session.group(method, on, _claim_tier)

    return group


@pytest.fixture
def verdict(request: pytest.FixtureRequest, _claim_tier: str) -> VerdictFixture:
    """Return `verdict(assertion)`, which judges the claim."""
    from evoclaims.claims.claim import ClaimTest
    from evoclaims.claims.verdict_fixture import VerdictFixture

    session, test = make_session(request.config), ClaimTest.of(request.node)
    line = progress_of(request.config)

    def settle(assertion: Any, readings: Any) -> ClaimReport:
        try:
            return session.settle(test, assertion, readings)
        finally:
            if line is not None:
                line.close()

    verdicts = request.node.stash[VERDICTS] = VerdictFixture(settle)
    return verdicts
