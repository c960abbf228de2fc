"""A session judges claims with trials that are run, or read, and compares them with the committed ones."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evoclaims.claims import earlier_trials
from evoclaims.claims.claim import Claim, ClaimTest
from evoclaims.claims.fetching import NotStoredError, RunMissing, StoredOnly
from evoclaims.claims.session import Session
from evoclaims.claims.verdict_fixture import VerdictFixture
from evoclaims.claims.workload import Work, Workload
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.packages import without_flags
from evoclaims.core.provenance import changing_flags
from evoclaims.execution.ahead import Ahead
from evoclaims.execution.host import Host
from evoclaims.execution.job import Job
from evoclaims.execution.worker import Ended, WorkOrder
from evoclaims.execution.workers import Workers
from evoclaims.judging.design import SEQUENTIAL
from evoclaims.judging.verdict import Outcome
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper import pilots, references
from evoclaims.paper.archive import Archive
from evoclaims.paper.cost import Cost
from evoclaims.paper.reproduction import Reproduction, Variant
from evoclaims.trials.layout import Layout
from evoclaims.trials.progress import ignore
from evoclaims.trials.result import Status, TrialResult
from evoclaims.trials.spec import Budget, Condition, TrialSpec
from evoclaims.trials.store import Store
from evoclaims.verdicts import history
from evoclaims.verdicts.history import AcceptedVerdict

Made = Callable[..., TrialResult]


def _ahead(session: Session, store: Store, gpus: tuple[str, ...] = (), limit: float = 1e9) -> Ahead:
    """Return what runs trials of a session in processes of a host with two cores."""
    order = WorkOrder(str(store.root), "", "cpu", 0, 0)
    return Ahead(Host(2, gpus), order, session.reproduction, store, limit, print)


def _works(condition: Condition, count: int) -> dict[str, Work]:
    """Return the work on a condition of which so many trials are missing."""
    cost = Cost(1.0, 1.0, 12, Layout.ALONE)
    return {condition.id: Work(("better", "small"), ("smoke",), "", 0, dict.fromkeys(range(count), ""), cost)}


def _from_here(condition: Condition) -> dict[str, Any]:
    """Return the provenance of trials that are made by what is installed."""
    return {"versions": without_flags(condition.versions), "xla_flags": changing_flags()}


def _value(condition: Condition, seed: int) -> float:
    return 0.5 + seed / 100 if condition.method.name == "hand_built" else seed / 100


@pytest.fixture
def session(reproduction: Reproduction, store: Store, served: Any) -> Session:
    """A session in which "better" is better."""
    return Session(reproduction, store, served(_value))


def _pair(session: Session, tier: str = "smoke") -> tuple[Any, Any]:
    return session.group("better", "small", tier), session.group("worse", "small", tier)


def test_a_claim_ends_supported_or_refuted_and_names_its_trials(session: Session, says: Claim) -> None:
    better, worse = _pair(session)
    report = session.settle(ClaimTest(says, "smoke", "small"), better.mean_success > worse.mean_success)
    assert (report.name, report.outcome, report.n, report.tier) == ("T1[small]", "supported", 6, "smoke")
    assert report.statement == says.smoke
    assert [(s.method, s.task, len(s.trials)) for s in report.sources] == [
        ("better", "small", 6),
        ("worse", "small", 6),
    ]
    assert report.sources[0].trials[3] == session.fetch(better.condition, [3])[0].id
    other = session.settle(ClaimTest(says, "smoke", "small"), worse.mean_success > better.mean_success)
    assert other.outcome == "refuted"
    assert other.failed


def test_the_full_tier_judges_the_papers_own_sentence_with_its_own_design(session: Session, says: Claim) -> None:
    better, worse = _pair(session, "full")
    report = session.settle(ClaimTest(says, "full", ""), better.mean_success > worse.mean_success)
    assert (report.name, report.n, report.statement) == ("T1", 10, says.says)
    assert [look.n for look in report.attainable] == [10]


def test_a_report_names_all_trials_that_were_looked_at_though_copies_count_once(
    session: Session, says: Claim, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(HandBuilt, "deterministic", False)

    def fetch(condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        trials = session.fetch(condition, seeds)
        return [replace(one, champion="c" * 64, curves={}) if one.seed < 3 else one for one in trials]

    copying = replace(session, fetch=fetch)
    better, worse = _pair(copying, "full")
    report = copying.settle(ClaimTest(says, "full", ""), better.mean_success > worse.mean_success)
    assert "(seeds 0, 1, 2)" in report.reason
    assert "n = 8 instead of 10" in report.reason
    assert report.n == 10
    assert report.sources[0].trials == tuple(TrialSpec(better.condition, seed).id for seed in range(10))


def test_a_fixed_number_of_trials_takes_the_place_of_the_looks(session: Session, says: Claim) -> None:
    fixed = replace(session, trials=4)
    assert [(look.n, look.alpha) for look in fixed.design("full").looks] == [(4, pytest.approx(0.05))]
    better, worse = _pair(fixed)
    assert fixed.settle(ClaimTest(says, "smoke", ""), better.mean_success > worse.mean_success).n == 4
    report = replace(session, trials=1).settle(ClaimTest(says, "smoke", ""), better.mean_success > worse.mean_success)
    assert (report.outcome, report.n) == ("inconclusive", 0)
    assert "underpowered: needs n = 3" in report.reason


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (("bettr", "small", "smoke"), "no method named 'bettr'. Did you mean 'better'? Known: better, worse."),
        (("better", "smal", "smoke"), "no task for better named 'smal'. Did you mean 'small'? Known: large, small."),
        (("better", "small", "fulll"), "no tier named 'fulll'. Did you mean 'full'? Known: full, smoke."),
    ],
)
def test_an_unknown_name_is_a_sentence_with_the_known_ones(
    session: Session, names: tuple[str, str, str], sentence: str
) -> None:
    with pytest.raises(UserError) as caught:
        session.group(*names)
    assert str(caught.value) == f"There is {sentence}"


def test_a_condition_that_only_the_other_tier_has_is_named_with_that_tier(session: Session) -> None:
    plain = session.reproduction
    fewer = {("better", "small"): plain.tiers["full"].conditions["better", "small"]}
    lacking = replace(plain, tiers={**plain.tiers, "full": replace(plain.tiers["full"], conditions=fewer)})
    here = replace(session, reproduction=lacking)
    for method, task, what in (("worse", "small", "method 'worse'"), ("better", "large", "task 'large' for better")):
        with pytest.raises(UnknownNameError) as caught:
            here.group(method, task, "full")
        assert str(caught.value) == (f"The full tier has no {what} (smoke has it): add a condition to the full tier.")
    with pytest.raises(UserError, match="no method named 'wors'"):
        here.group("wors", "small", "full")


def test_trials_that_may_not_be_run_end_a_claim_as_not_run(
    reproduction: Reproduction, store: Store, says: Claim, made: Made
) -> None:
    stored = Session(reproduction, store, StoredOnly(Archive(store)))
    better, worse = _pair(stored)
    for seed in range(6):
        store.put(made(better.condition, seed, 1.0), {})
    report = stored.settle(ClaimTest(says, "smoke", ""), better.mean_success > worse.mean_success)
    assert (report.outcome, report.n, report.failed) == ("not run", 0, False)
    assert report.reason.startswith("worse on small: 6 of 6 trials are missing")
    assert len(report.fingerprint) == 64
    for seed in range(6):
        store.put(made(worse.condition, seed, 0.0), {})
    assert stored.settle(ClaimTest(says, "smoke", ""), better.mean_success > worse.mean_success).outcome == "supported"


def test_a_stored_trial_is_read_once_and_a_missing_one_is_looked_for_again(
    store: Store, made: Made, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    condition, read = session.group("better", "small", "smoke").condition, list[str]()
    monkeypatch.setattr(Archive, "get", lambda self, trial, versions: read.append(trial) or store.get(trial, versions))
    stored = StoredOnly(Archive(store))
    store.put(made(condition, 0, 1.0), {})
    with pytest.raises(NotStoredError, match="1 of 2 trials"):
        stored(condition, [0, 1])
    store.put(made(condition, 1, 1.0), {})
    assert [trial.seed for trial in stored(condition, [1, 0])] == [1, 0]
    first, second = (made(condition, seed, 1.0).id for seed in (0, 1))
    assert read == [first, second, second]


def test_missing_trials_are_run_and_a_bad_store_or_device_is_found_before(tmp_path: Path, session: Session) -> None:
    condition = session.group("better", "small", "smoke").condition
    mode = RunMissing(Store(tmp_path / "new"), "cpu", ignore)
    mode.check()
    assert [trial.metrics["mean_success"] for trial in mode(condition, [1, 0])] == [1.0, 1.0]
    (tmp_path / "file").write_text("")
    for bad in (RunMissing(Store(tmp_path / "file"), "cpu", ignore), StoredOnly(Archive(Store(tmp_path / "file")))):
        with pytest.raises(UserError, match="is a file, not a folder"):
            bad.check()
    with pytest.raises(UserError, match="There is no device named 'tpu'"):
        RunMissing(Store(tmp_path / "new"), "tpu", ignore).check()


def test_a_test_gives_exactly_one_verdict(session: Session, says: Claim) -> None:
    better, worse = _pair(session)
    verdict = VerdictFixture(lambda assertion, _: session.settle(ClaimTest(says, "smoke", ""), assertion))
    with pytest.raises(UserError, match=r"takes an assertion about trials.*not True"):
        verdict(True)  # type: ignore[arg-type]
    with pytest.raises(UserError, match=r"takes an assertion about trials.*not 'mean success over levels' alone"):
        verdict(better.mean_success)  # type: ignore[arg-type]
    with pytest.raises(UserError, match=r"not 'solves every level' alone: say in how many it holds, as in .in_most_tr"):
        verdict(better.solves_every_level)  # type: ignore[arg-type]
    with pytest.raises(UserError, match=r"was given the function in_most_trials itself: call it, as in in_most_tria"):
        verdict(better.solves_every_level.in_most_trials)  # type: ignore[arg-type]
    assert verdict.report is None
    verdict(better.mean_success > worse.mean_success)
    assert verdict.report is not None
    with pytest.raises(UserError, match="A claim has one verdict: join several assertions with &"):
        verdict(better.mean_success > worse.mean_success)


def _committed(session: Session, made: Made, value: Callable[[int], float]) -> None:
    """Write ten reference trials of "better on small" at the smoke tier."""
    better, _ = _pair(session)
    path = references.path_of(session.reproduction.references, "smoke", "better", "small")
    references.write(path, [made(better.condition, seed, value(seed)) for seed in range(10)])


def _settled(session: Session, made: Made, says: Claim, value: Callable[[int], float]) -> Sequence[Any]:
    """Store new trials and judge a claim about them."""
    better, _ = _pair(session)
    for seed in range(6):
        session.store.put(made(better.condition, seed, value(seed)), {})
    return [session.settle(ClaimTest(says, "smoke", ""), better.solves_every_level.in_most_trials())]


def test_the_same_trials_have_not_drifted(session: Session, says: Claim, made: Made) -> None:
    _committed(session, made, lambda seed: seed / 10)
    drift, digests = earlier_trials.drift(session, _settled(session, made, says, lambda seed: seed / 10))
    assert not drift.drifted
    assert [(row.metric, row.status, row.n_new, row.n_ref) for row in drift.rows] == [
        ("success at level 0", "no drift", 6, 10),  # what the claim reads
        ("success at level 1", "no drift", 6, 10),
        ("mean_success", "no drift", 6, 10),
        ("last_fitness", "no drift", 6, 10),
        ("environment_steps", "no drift", 6, 10),
    ]
    assert digests.compared == 0  # these records do not say where they were made


def test_shifted_trials_have_drifted(session: Session, says: Claim, made: Made) -> None:
    _committed(session, made, lambda seed: seed / 100)
    drift, _ = earlier_trials.drift(session, _settled(session, made, says, lambda seed: 0.5 + seed / 100))
    assert drift.drifted
    assert [row.metric for row in drift.rows if row.drifted] == [
        "success at level 0",
        "success at level 1",
        "mean_success",
        "last_fitness",
    ]


def test_under_a_variant_what_it_does_not_change_is_compared_too(session: Session, says: Claim, made: Made) -> None:
    """The variant "other" has the conditions of "longer", whose reference trials lie under that name alone."""
    longer = replace(_pair(session)[0].condition, budget=Budget(generations=3))
    changes = {name: Variant("", {"smoke": {("better", "small"): longer}}) for name in ("longer", "other")}
    reproduction = replace(session.reproduction, variants=changes)
    worse = _pair(session)[1].condition
    for folder, name, condition in (
        (reproduction.references, "better", _pair(session)[0].condition),
        (reproduction.references, "worse", worse),
        (reproduction.references_of("longer"), "better", longer),
    ):
        path = references.path_of(folder, "smoke", name, "small")
        references.write(path, [made(condition, seed, seed / 100) for seed in range(10)])
    for seed in range(6):
        session.store.put(made(longer, seed, seed / 100), {})
        session.store.put(made(worse, seed, 0.5 + seed / 100), {})
    for variant in changes:
        under = replace(session, reproduction=reproduction, variant=variant)
        better, same = _pair(under)
        drift, _ = earlier_trials.drift(
            under, [under.settle(ClaimTest(says, "smoke", ""), better.mean_success > same.mean_success)]
        )
        assert [(row.label, row.status) for row in drift.rows if row.metric == "mean_success"] == [
            ("better on small (smoke)", "no drift"),
            ("worse on small (smoke)", "drift"),
        ]


def test_stored_trials_that_were_not_judged_have_no_part_in_the_drift(
    session: Session, says: Claim, made: Made
) -> None:
    """Those that ran out of time here stand back behind older ones, and older ones behind committed ones of here."""
    better, store = _pair(session)[0].condition, session.store
    packages, versions = list(better.packages), without_flags(better.versions)
    here = {"versions": versions, "depends_on": packages, "xla_flags": changing_flags()}
    before = {**here, "versions": {**versions, "jax": "0.0.1"}}
    path = references.path_of(session.reproduction.references, "smoke", "better", "small")
    references.write(path, [made(better, seed, 1.0, **before) for seed in range(10)])
    for seed in range(10):
        store.put(made(better, seed, 0.0, "timeout", **here), {})
        store.put(made(better, seed, 1.0, **before), {})

    def statuses(archive: Archive) -> set[str]:
        reading = replace(session, fetch=StoredOnly(archive), trials=10)
        group = reading.group("better", "small", "smoke")
        report = reading.settle(ClaimTest(says, "smoke", ""), group.solves_every_level.in_most_trials())
        assert report.outcome == "supported"
        return {row.status for row in earlier_trials.drift(reading, [report])[0].rows}

    assert statuses(Archive(store)) == {"no drift"}
    references.write(path, [made(better, seed, 1.0, **here) for seed in range(10)])
    assert statuses(Archive(store, session.reproduction.references)) == set()


def _with_more(session: Session, more: int) -> Session:
    """Return a session whose smoke tier makes more trials of "better on small" for the drift check."""
    tiers = session.reproduction.tiers
    smoke = replace(tiers["smoke"], for_drift={("better", "small"): more})
    return replace(session, reproduction=replace(session.reproduction, tiers={**tiers, "smoke": smoke}))


def test_trials_for_the_drift_check_are_read_by_no_claim_and_count_when_all_are_there(
    session: Session, says: Claim, made: Made
) -> None:
    session = _with_more(session, 4)
    better = _pair(session)[0].condition
    _committed(session, made, lambda seed: seed / 10)
    place = pilots.path_of(session.reproduction.folder, "smoke", "better", "small", second=False)
    reads = _pair(session)[0].solves_every_level.in_most_trials().readings()
    pilots.write(place, [made(better, seed, seed / 100) for seed in range(9, 39)], reads)
    trials = []
    for seed in (6, 7, 8, 9):
        (report,) = _settled(session, made, says, lambda seed: seed / 20)
        assert (report.n, len(report.sources[0].trials)) == (6, 6)
        rows = {row.metric: row for row in earlier_trials.drift(session, [report])[0].rows}
        trials.append((rows["success at level 0"].n_new, rows["success at level 0"].n_ref))
        session.store.put(made(better, seed, seed / 10), {})
    rows = {row.metric: row for row in earlier_trials.drift(session, [report])[0].rows}
    trials.append((rows["success at level 0"].n_new, rows["success at level 0"].n_ref))
    assert trials == [(6, 40)] * 4 + [(10, 39)]  # the pilot's seed 9 is now a new trial


def test_trials_for_the_drift_check_run_once_with_the_last_that_claims_read(tmp_path: Path, session: Session) -> None:
    session = _with_more(session, 2)
    condition, more = _pair(session)[0].condition, session.reproduction.seeds_for_drift
    assert more == {condition.id: range(6, 8)}

    def seeds(**kwargs: Any) -> tuple[list[int], int]:
        store = Store(tmp_path / str(len(list(tmp_path.iterdir()))))
        mode = RunMissing(store, "cpu", ignore, for_drift=more, **kwargs)
        return [trial.seed for trial in mode(condition, range(wanted))], len(store.ids())

    wanted = 6
    assert seeds() == ([*range(6)], 8)
    assert seeds(time_limit=60.0) == ([*range(6)], 6)
    for wanted, there in ((5, 5), (7, 8)):
        assert seeds() == ([*range(wanted)], there)
    store = Store(tmp_path / "once")
    mode = RunMissing(store, "cpu", ignore, for_drift=more)
    mode(condition, range(6))
    store.record_path(TrialSpec(condition, 7).id, condition.versions).unlink()
    assert (len(mode(condition, range(6))), len(store.ids())) == (6, 7)


def test_trials_for_the_drift_check_count_where_they_ended_and_have_the_versions_of_the_others(
    session: Session, says: Claim, made: Made
) -> None:
    """A run that makes none of them, as on a GPU or after an upgrade under a short limit, finds older ones."""
    session = _with_more(session, 2)
    better = _pair(session)[0].condition
    _committed(session, made, lambda seed: seed / 10)
    reports = _settled(session, made, says, lambda seed: seed / 10)

    def counted(**kwargs: Any) -> int:
        for seed in (6, 7):
            for path in session.store.record_files(TrialSpec(better, seed).id):
                path.unlink(missing_ok=True)
            session.store.put(made(better, seed, seed / 10, **(kwargs if seed == 7 else {})), {})
        return int(earlier_trials.drift(session, reports)[0].rows[0].n_new)

    assert counted() == 8
    assert counted(versions={"jax": "0.0"}) == 6
    assert counted(status="timeout") == 6


def test_a_claim_whose_trials_are_there_is_judged_where_those_for_the_drift_check_cannot_be_made(
    tmp_path: Path, session: Session
) -> None:
    session = _with_more(session, 2)
    condition, more = _pair(session)[0].condition, session.reproduction.seeds_for_drift
    store = Store(tmp_path / "damaged")
    assert len(RunMissing(store, "cpu", ignore, for_drift=more)(condition, range(6))) == 6
    for seed, whole in ((7, True), (5, False)):
        store.record_path(TrialSpec(condition, seed).id, condition.versions).write_text("{")
        ahead = _ahead(session, store)
        ahead._errors[condition.id] = "the store is damaged"
        for wait in (_no_wait, ahead.wait):
            mode = RunMissing(store, "cpu", ignore, wait=wait, for_drift=more)
            if whole:
                assert [trial.seed for trial in mode(condition, range(6))] == [*range(6)]
                # The drift check itself names a file that it cannot read.
                assert mode.unmade == ({} if wait is _no_wait else {condition.id: "the store is damaged"})
            else:
                with pytest.raises(UserError, match=r"it is not one whole JSON text|the store is damaged"):
                    mode(condition, range(6))


def _no_wait(condition: Condition, seeds: Sequence[int]) -> None:
    pass


def test_trials_for_the_drift_check_are_asked_of_processes_on_cpus_alone(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a condition whose claim may come to a third look of twelve trials."""
    session = _with_more(session, 4)
    condition = _pair(session)[0].condition

    def ahead(gpus: tuple[str, ...], limit: float) -> tuple[int, ...]:
        asked: list[Job] = []
        monkeypatch.setattr(
            Ahead, "_run", lambda self, runs: asked.extend(job for run in runs for job in run.conditions)
        )
        one, works = _ahead(session, session.store, gpus, limit), _works(condition, 12)
        one.start(Workload("", {"claim": (condition.id,)}, works), {"smoke": range(6)})
        one.stop()
        return asked[0].seeds

    assert ahead((), 1e9) == (*range(10),)
    assert ahead(("0", "1"), 1e9) == (*range(6),)
    assert ahead((), 60.0) == (*range(6),)


@pytest.mark.parametrize(("gpus", "first"), [(("0", "1"), "ahead"), ((), "due now")])
def test_what_was_not_asked_for_beforehand_waits_for_gpus(
    session: Session, made: Made, monkeypatch: pytest.MonkeyPatch, gpus: tuple[str, ...], first: str
) -> None:
    better, worse = (group.condition for group in _pair(session))
    log, judged = list[str](), threading.Event()

    def run_ahead(ahead: Ahead, runs: object) -> None:
        judged.wait(0.3 if gpus else 60.0)
        log.append("ahead")

    def run(workers: Workers, groups: Sequence[Sequence[Job]]) -> Iterator[Ended]:
        log.append("due now")
        session.store.put(made(worse, 0, 1.0, **_from_here(worse)), {})
        yield Ended(groups[0][0])

    monkeypatch.setattr(Ahead, "_run", run_ahead)
    monkeypatch.setattr(Workers, "run", run)
    ahead, works = _ahead(session, session.store, gpus), _works(better, 6)
    ahead.start(Workload("", {"claim": tuple(works)}, works), {"smoke": range(6)})
    ahead.wait(worse, [0])
    judged.set()
    ahead.stop()
    assert (log[0], len(log)) == (first, 2)


@pytest.mark.parametrize("known", [True, False])
def test_a_trial_that_crashes_in_a_worker_is_run_once_and_its_claim_says_so(
    session: Session, says: Claim, made: Made, monkeypatch: pytest.MonkeyPatch, known: bool
) -> None:
    """Whether it is known beforehand that the claim needs it, or not."""
    better, ran = _pair(session)[0], list[tuple[int, ...]]()

    def run(workers: Workers, groups: Sequence[Sequence[Job]]) -> Iterator[Ended]:
        for job in groups[0]:
            ran.append(job.seeds)
            for seed in job.seeds:
                status: Status = "crashed" if seed == 3 else "done"
                session.store.put(made(better.condition, seed, 1.0, status, **_from_here(better.condition)), {})
            yield Ended(job)

    monkeypatch.setattr(Workers, "run", run)
    ahead, works = _ahead(session, session.store), _works(better.condition, 6)
    ahead.start(Workload("", {"claim": tuple(works)} if known else {}, works if known else {}), {"smoke": range(6)})
    running = replace(session, fetch=RunMissing(session.store, "cpu", ignore, wait=ahead.wait))
    for _ in range(2):
        better = _pair(running)[0]
        report = running.settle(ClaimTest(says, "smoke", ""), better.solves_every_level.in_most_trials())
        assert (report.outcome, ran) == ("error", [(*range(6),)])
        assert "1 of 6 trials of better on small crashed (seed 3)" in report.reason


def test_an_interrupt_before_anything_has_begun_in_processes_ends_the_run(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Interrupted(threading.Thread):
        def start(self) -> None:
            raise KeyboardInterrupt

    ahead, works = _ahead(session, session.store), _works(_pair(session)[0].condition, 1)
    with monkeypatch.context() as patch:
        patch.setattr("evoclaims.execution.ahead.threading.Thread", Interrupted)
        with pytest.raises(KeyboardInterrupt):
            ahead.start(Workload("", {"claim": tuple(works)}, works), {"smoke": range(6)})
    ahead.stop()


@pytest.mark.parametrize("more", [0, 95])
def test_a_tier_refuses_trials_for_drift_that_cannot_be_compared(session: Session, more: int) -> None:
    with pytest.raises(UserError, match=f"for_drift={more} more trials of better on small"):
        _with_more(session, more)
    smoke = session.reproduction.tiers["smoke"]
    with pytest.raises(UserError, match="no method named 'bettr'"):
        replace(smoke, for_drift={("bettr", "small"): 1})


def test_without_reference_trials_nothing_is_said_to_be_unchanged(session: Session, says: Claim, made: Made) -> None:
    drift, _ = earlier_trials.drift(session, _settled(session, made, says, lambda seed: 1.0))
    assert {row.status for row in drift.rows} == {"no reference"}
    assert not drift.drifted
    assert len(drift.unchecked) == 5


def test_a_lost_support_comes_with_how_often_draws_from_the_pilots_lose_it(
    session: Session, says: Claim, made: Made
) -> None:
    """Overlapping trials are inconclusive; a pilot without overlap never ends so, and one like them often does."""
    better, worse = _pair(session)
    for seed in range(6):
        session.store.put(made(better.condition, seed, seed / 10), {})
        session.store.put(made(worse.condition, seed, seed / 10), {})

    def chance() -> float | None:
        reading = replace(session, fetch=StoredOnly(Archive(session.store)))  # a session reads what is accepted once
        groups = _pair(reading)
        assertion = groups[0].mean_success > groups[1].mean_success
        report = replace(reading).settle(ClaimTest(says, "smoke", ""), assertion)  # a session reads verdicts once
        assert report.outcome == "inconclusive"
        return report.chance

    assert chance() is None  # nothing has been accepted
    before = AcceptedVerdict(Outcome.SUPPORTED, "", 6, 0.01, "f" * 64, "2026-01-01", {}, "cpu", "", "t" * 64)
    path = session.reproduction.folder / history.FILE
    path.parent.mkdir(exist_ok=True)
    path.write_text(history.dump({("smoke", "T1"): (before,)}))
    assert chance() is None  # no pilot
    for lead, low, high in ((1.0, 0.0, 0.0), (0.0, 0.5, 1.0)):
        for name, group, shift in (("better", better, lead), ("worse", worse, 0.0)):
            trials = [made(group.condition, 100 + seed, seed / 100 + shift) for seed in range(20)]
            place = pilots.path_of(session.reproduction.folder, "smoke", name, "small", second=False)
            pilots.write(place, trials, [group.mean_success])
        found = chance()
        assert found is not None
        assert low <= found <= high
    path.write_text(history.dump({("smoke", "T1"): (replace(before, outcome=Outcome.REFUTED),)}))
    assert chance() is None


def test_a_third_look_follows_the_first_two_and_is_another_design(session: Session, says: Claim) -> None:
    tiers = session.reproduction.tiers
    full = replace(tiers["full"], design=SEQUENTIAL)
    session = replace(session, reproduction=replace(session.reproduction, tiers={**tiers, "full": full}))
    better, worse = _pair(session, "full")
    assertion = better.mean_success > worse.mean_success
    text = frozenset({""})
    two, three = (session.settle(ClaimTest(says, "full", "", third), assertion) for third in (frozenset[str](), text))
    assert [(look.n, look.alpha) for look in three.attainable] == [(5, 0.01), (10, 0.04), (30, 0.0095)]
    assert [look.n for look in two.attainable] == [5, 10]
    assert (three.outcome, three.n, three.reason) == (two.outcome, two.n, two.reason)
    assert three.fingerprint != two.fingerprint
    smoke = session.settle(ClaimTest(says, "smoke", "", text), _pair(session)[0].solves_every_level.in_most_trials())
    assert [look.n for look in smoke.attainable] == [6]  # its α is spent


def test_a_third_look_under_a_variant_is_named_by_its_mark(session: Session) -> None:
    tiers = session.reproduction.tiers
    tiers = {**tiers, "full": replace(tiers["full"], design=SEQUENTIAL)}
    reproduction = replace(session.reproduction, tiers=tiers, variants={"longer": Variant("", {})})
    for variant, looks in {"": {"": 3, "longer": 2}, "longer": {"": 2, "longer": 3}}.items():
        judging = replace(session, reproduction=reproduction, variant=variant)
        assert {name: len(judging.design("full", {name}).looks) for name in ("", "longer")} == looks
    with pytest.raises(UserError, match="no variant with a third look named 'longest'.*longer"):
        judging.design("full", {"longest"})
