"""A trial has a record for each set of versions that it was run with: none answers for another, and none is lost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from climbers import CLIMBING, SEEDS, Log, run_climbers
from trial_toys import StoppedError, stopping

from evoclaims.core import packages, provenance
from evoclaims.trials import checkpoint
from evoclaims.trials.arrays import unpack
from evoclaims.trials.batches import StoredTrials, drop_finished_checkpoints
from evoclaims.trials.integrity import verify
from evoclaims.trials.result import TrialResult, digest
from evoclaims.trials.runner import run
from evoclaims.trials.spec import TrialSpec
from evoclaims.trials.store import DamagedFileError, Store

Make = Callable[..., TrialResult]
OLD, NEW = {"evosax": "1", "jax": "1"}, {"evosax": "2", "jax": "1"}
OTHER = {"evosax": "2", "jax": "2"}


def _made(
    make_result: Make, versions: dict[str, str], score: float, ended: str = "2025-01-01", **fields: Any
) -> TrialResult:
    """Return a trial that was made with these versions."""
    result = make_result(metrics={"mean_success": score}, **fields)
    provenance = {"versions": {**versions, "pandas": "3"}, "depends_on": sorted(versions)}
    return replace(result, provenance=provenance, timing={**result.timing, "ended": ended})


def _as_before(store: Store, result: TrialResult, champion: dict[str, Any]) -> Path:
    """Store a record that does not say what it depends on, as some committed ones: under its id alone."""
    provenance = {name: value for name, value in result.provenance.items() if name != "depends_on"}
    store.put(replace(result, provenance=provenance), champion)
    return store.record_path(result.id)


def test_every_record_of_a_trial_stays_whichever_comes_first(store: Store, make_result: Make, tmp_path: Path) -> None:
    made = [
        _made(make_result, versions, score, ended, champion={})
        for versions, score, ended in ((OLD, 0.0, "2025-01"), (NEW, 0.5, "2025-03"), (OTHER, 1.0, "2025-02"))
    ]
    for number, order in enumerate(permutations(made)):
        one = Store(tmp_path / str(number))
        assert [one.put(result, {}) for result in order] == ["stored"] * 3
        assert [one.put(result, {}) for result in order] == ["present"] * 3
        for result, versions in zip(made, (OLD, NEW, OTHER), strict=True):
            assert one.made_with(result.id, versions) == result
            assert one.get(result.id, versions) == result
        elsewhere = {**OLD, "qdax": "1"}
        assert one.made_with(made[0].id, elsewhere) is None
        assert one.get(made[0].id, elsewhere) == one.get(made[0].id) == made[1]  # the newest, to be judged all the same
        assert one.made_with(made[2].id, {"jax": "2"}) == made[2]  # its condition declared another package then
        assert one.ids() == (made[0].id,)
        assert len(list(one.results([]))) == 3
        assert verify(one, repair=False) == []


def test_a_record_answers_for_its_own_flags_of_xla_alone(store: Store, make_result: Make) -> None:
    plain, slow = (_made(make_result, OLD, score, champion={}) for score in (1.0, 0.5))
    dumped = {**plain.provenance, "xla_flags": "--xla_dump_to=here"}
    plain = replace(plain, provenance=dumped)  # which changes no trial
    slow = replace(slow, provenance={**slow.provenance, "xla_flags": "--xla_level=0 --xla_dump_to=here"})
    flagged = {**OLD, packages.FLAGS: "--xla_level=0"}
    for first, second in ((plain, slow), (slow, plain)):
        one = Store(store.root / first.digest[:8])
        assert [one.put(result, {}) for result in (first, second)] == ["stored"] * 2
        assert (one.made_with(plain.id, OLD), one.made_with(plain.id, flagged)) == (plain, slow)
        assert one.made_with(plain.id, {**OLD, packages.FLAGS: "--xla_level=1"}) is None
        assert verify(one, repair=False) == []


def test_a_record_of_an_older_release_answers_by_what_its_provenance_says(store: Store, make_result: Make) -> None:
    old = _made(make_result, OLD, 1.0, champion={"w": np.zeros(1)})
    new = _made(make_result, NEW, 0.0, champion={"w": np.ones(1)})
    path = _as_before(store, old, {"w": np.zeros(1)})
    assert path.name == f"{old.id}.json"
    found = store.made_with(old.id, OLD)
    assert found is not None
    assert found.digest == old.digest
    assert store.made_with(old.id, NEW) is None
    assert store.put(old, {"w": np.zeros(1)}) == "present"
    assert store.put(new, {"w": np.ones(1)}) == "stored"
    assert (store.made_with(old.id, OLD), len(store.records(old.id))) == (found, 2)
    assert verify(store, repair=False) == []


def test_each_record_keeps_its_own_champion(store: Store, make_result: Make) -> None:
    old, new, same = (_made(make_result, versions, 0.5) for versions in (OLD, NEW, OTHER))
    store.put(old, {"w": np.zeros(3)})
    store.put(new, {"w": np.ones(3)})
    store.put(same, {"w": np.ones(3)})
    held = [store.get(old.id, versions) for versions in (OLD, NEW, OTHER)]
    assert [store.champion_of(result)["w"].tolist() for result in held if result] == [[0.0] * 3, [1.0] * 3, [1.0] * 3]
    assert len(store.champion_files(old.id)) == 2
    assert all(store.has_champion(result) for result in held if result)
    assert not store.has_champion(replace(old, champion="0" * 64))


def test_a_torn_record_is_told_where_it_counts_and_leaves_the_others_alone(store: Store, make_result: Make) -> None:
    old, new = _made(make_result, OLD, 0.5), _made(make_result, NEW, 0.5, champion={"w": np.ones(3)})
    store.put(old, {"w": np.zeros(3)})
    store.put(new, {"w": np.ones(3)})
    torn = store.home(old)
    torn.write_bytes(b"torn")
    assert store.made_with(new.id, NEW) is not None
    with pytest.raises(DamagedFileError, match="whole JSON text"):
        store.made_with(old.id, OLD)
    problems = verify(store, repair=True)
    assert [(problem.kind, problem.path) for problem in problems] == [
        ("record", torn),
        ("champion", store.champion_path(old.id)),
    ]
    assert verify(store, repair=False) == []
    assert store.champion_of(store.get(new.id))["w"].tolist() == [1.0] * 3


def test_a_record_under_the_name_of_other_versions_is_foreign(store: Store, make_result: Make) -> None:
    old, new = _made(make_result, OLD, 0.5), _made(make_result, NEW, 0.5)
    store.put(old, {})
    store.home(old).rename(store.home(new))
    with pytest.raises(DamagedFileError, match="its name is not that of the versions that it was made with"):
        store.made_with(old.id, NEW)


@pytest.fixture
def upgraded(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """A function after which this process believes another numpy to be installed."""
    there = packages.version_of

    def upgrade() -> None:
        for module in (packages, provenance):
            monkeypatch.setattr(module, "version_of", lambda name: "99" if name == "numpy" else there(name))

    return upgrade


def test_after_an_upgrade_trials_run_again_and_both_records_stay(
    store: Store, cpus: list[Any], puts: Any, upgraded: Callable[[], None]
) -> None:
    before = run_climbers(store, cpus)
    run_climbers(store, cpus)
    upgraded()
    assert run(CLIMBING, SEEDS, store, cpus, any_version=True) == before
    assert set(puts.values()) == {1}
    again = run_climbers(store, cpus)
    assert set(puts.values()) == {2}
    assert [result.provenance["versions"]["numpy"] for result in again] == ["99"] * len(SEEDS)
    assert [result.digest for result in again] == [result.digest for result in before]
    assert [len(store.records(result.id)) for result in again] == [2] * len(SEEDS)
    run_climbers(store, cpus)
    run(CLIMBING, SEEDS, store, cpus, any_version=True)
    assert set(puts.values()) == {2}


def test_with_any_version_a_trial_that_ended_elsewhere_comes_before_one_out_of_time_here(
    store: Store, cpus: list[Any], upgraded: Callable[[], None]
) -> None:
    ended = next(result for result in run_climbers(store, cpus) if result.status == "done")
    upgraded()
    late = replace(
        ended,
        status="timeout",
        metrics={},
        levels={},
        champion="",
        digest=digest("timeout", {}, {}, ended.curves, b""),
        timing={**ended.timing, "limit": 1.0, "ended": "2999-01-01"},
        provenance={**ended.provenance, "versions": {**ended.provenance["versions"], "numpy": "99"}},
    )
    assert store.put(late, {}) == "stored"
    here = StoredTrials(store, CLIMBING).get(ended.seed)
    assert here is not None
    assert here.status == "timeout"
    assert StoredTrials(store, CLIMBING, any_version=True).get(ended.seed) == ended


def test_a_checkpoint_of_other_versions_is_neither_gone_on_with_nor_dropped(
    store: Store, cpus: list[Any], puts: Any, upgraded: Callable[[], None]
) -> None:
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(2))
    (path,) = store.checkpoints.iterdir()
    upgraded()
    log = Log()
    run_climbers(store, cpus, log)
    assert "resuming" not in log.phases()
    run(CLIMBING, SEEDS, store, cpus, any_version=True)  # trials of other versions stand for its own
    assert path.exists()


def test_a_finished_checkpoint_of_these_versions_is_dropped(
    store: Store, uninterrupted: list[TrialResult], cpus: list[Any]
) -> None:
    with pytest.raises(StoppedError):
        run_climbers(store, cpus, stopping(2))
    (path,) = store.checkpoints.iterdir()
    (header,) = checkpoint.sound_ones(store.checkpoints, CLIMBING.id)
    assert header.versions == packages.short_hash(CLIMBING.versions)
    state = checkpoint.restore(store.checkpoints, header, _shapes(path))
    for result in uninterrupted:
        store.put(replace(result, champion=""), {})
    for versions, stays in ((header.versions, False), ("0" * 16, True)):
        checkpoint.save(store.checkpoints, replace(header, versions=versions), state)
        drop_finished_checkpoints(StoredTrials(store, CLIMBING))
        assert path.exists() is stays


def _shapes(path: Path) -> Any:
    """Return what a checkpoint's state looks like, as a list of leaves."""
    arrays = unpack(path.read_bytes())
    return [jax.ShapeDtypeStruct(arrays[name].shape, arrays[name].dtype) for name in sorted(arrays.keys() - {"header"})]


def test_a_conditions_packages_are_no_part_of_its_id() -> None:
    class Needy(type(CLIMBING.method)):  # type: ignore[misc]
        packages = ("optax",)

    needy = replace(CLIMBING, method=Needy())
    assert "optax" in needy.packages
    assert needy.id == replace(CLIMBING, method=type(CLIMBING.method)()).id
    assert TrialSpec(needy, 0).id == TrialSpec(replace(needy, method=type(CLIMBING.method)()), 0).id
