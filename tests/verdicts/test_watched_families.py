"""A watch: families of conditions over nights, what an alarm names, and the file that nights are added to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from evoclaims.core.errors import UserError
from evoclaims.trials.result import TrialResult
from evoclaims.verdicts import watch_file
from evoclaims.verdicts.watch import ALPHA, Watch, Watched, _of_column, families, watched
from evoclaims.verdicts.watch_file import Night, append, load

SEEDS = (*range(10), *range(100, 150))
LEVEL = 25 / ALPHA
"""Of an alarm in a suite of about as many families as the committed reproduction's."""

TASKS = ("a", "b", "c", "d", "e")


def condition(method: str, task: str, values: Any, measure: str = "score", seeds: tuple[int, ...] = SEEDS) -> Watched:
    made: Any = SimpleNamespace(id=f"{method}-{task}", packages=("evosax", "numpy"), edited_since=lambda _: ())
    return Watched(
        (method, task), made, seeds, {measure: tuple(map(float, values))}, {"evosax": "1", "numpy": "2"}, ("cpu",)
    )


def normal(rng: np.random.Generator, shift: float = 0.0, n: int = 60) -> Any:
    return rng.normal(shift, size=n)


def night(watch: Watch, number: int, draw: Any, evosax: str = "1", before: tuple[Night, ...] = ()) -> Night:
    """Return a night whose values are `draw(label)`, with its evidence after the nights before."""
    seeds = tuple(range(10_000 + 10 * number, 10_010 + 10 * number))
    values = {one.label: {name: tuple(map(float, draw(one.label))) for name in one.values} for one in watch.conditions}
    versions = {"evosax": evosax, "numpy": "2"}
    made = Night(f"2026-01-{number + 1:02}", "smoke", 1, watch.rules, seeds, "cpu", watch.level, versions, values, {})
    evidence = {one.label: one.path((*before, made))[-1] for one in watch.families}
    return structs.replace(made, evidence=evidence)


def nights(watch: Watch, count: int, draw: Any) -> tuple[Night, ...]:
    found: tuple[Night, ...] = ()
    for number in range(count):
        found = (*found, night(watch, number, draw, before=found))
    return found


def test_half_a_standard_deviation_in_five_conditions_is_found_in_three_nights() -> None:
    found = []
    for run in range(11):
        rng = np.random.default_rng(run)
        (family,) = families([condition("ppo", task, normal(rng)) for task in TASKS])
        drawn = []
        for number in range(4):
            seeds = tuple(range(1000 + 10 * number, 1010 + 10 * number))
            values = {f"ppo on {task}": {"score": tuple(normal(rng, -0.5, 10).tolist())} for task in TASKS}
            drawn.append(Night("", "", 1, "", seeds, "", 0, {}, values, {}))
        found.append(next((at for at, one in enumerate(family.path(drawn), start=1) if one >= LEVEL), 5))
    assert np.median(found) <= 3


def test_conditions_that_repeat_each_other_count_once() -> None:
    """Trials of one seed may depend on each other: five equal conditions are as much evidence as one of them."""
    rng = np.random.default_rng(0)
    values, new = normal(rng), iter(normal(rng, 0.8, 100).reshape(10, 10).tolist())
    one, several = (Watch("smoke", tuple(condition("m", task, values) for task in those)) for those in ("a", TASKS))
    drawn = []
    for number in range(4):
        row = next(new)
        drawn.append(night(several, number, lambda _, row=row: row))
    once, often = (watch.families[0]._of_sum(drawn) for watch in (one, several))
    assert once[-1] > 3
    assert often == pytest.approx(once)


def test_families_are_methods_and_tasks_of_several_conditions() -> None:
    rng = np.random.default_rng(0)
    names = [("cma", "a"), ("cma", "b"), ("ppo", "a"), ("walk", "c")]
    found = families([condition(method, task, normal(rng)) for method, task in names])
    assert {one.label: [each.label for each in one.conditions] for one in found} == {
        "cma": ["cma on a", "cma on b"],
        "ppo": ["ppo on a"],
        "walk": ["walk on c"],
        "task a": ["cma on a", "ppo on a"],
    }
    few = condition("cma", "c", normal(rng, n=10), seeds=SEEDS[:10])
    assert [one.label for one in families([condition("cma", "a", normal(rng)), few])] == ["cma (a)", "cma (c)"]


def test_what_never_varies_is_no_evidence_until_it_does() -> None:
    watch = Watch("smoke", (condition("m", "a", [1.0] * 60), condition("m", "b", [1.0 + 1e-7] * 60)))
    assert [one.moves for one in watch.families] == [False]
    same = nights(watch, 3, lambda _: [1.0] * 10)
    path = [one.evidence["m"] for one in same]
    assert path[0] < 1
    assert path == sorted(path, reverse=True)
    assert watch.alarms(same) == {}
    changed = night(watch, 3, lambda label: [1.0] * 10 if label == "m on a" else [0.0] * 10, before=same)
    ((_, *lines),) = watch.alarms((*same, changed)).values()
    assert lines[0] == "  moved: m on b: score is lower: median 1 -> 0, A12 = 0.00"


def test_trials_that_diverge_rank_below_all_others() -> None:
    rng = np.random.default_rng(0)
    watch = Watch("smoke", (condition("m", "a", normal(rng)),))
    found = nights(watch, 2, lambda _: [-np.inf] * 10)
    assert "score is lower" in watch.alarms(found)["m"][1]
    steady = Watch("smoke", (condition("m", "a", [1.0] * 60),))
    assert "median 1 -> -inf, A12 = 0.00" in steady.alarms(nights(steady, 1, lambda _: [-np.inf] * 10))["m"][1]


def record(seed: int, status: Any = "done", versions: Any = (), **metrics: float) -> TrialResult:
    curves = {"fitness": (metrics["score"], 1.0)} if "score" in metrics else {}
    provenance = {"versions": dict(versions), "device": {"kind": "cpu"}}
    return TrialResult("", "m-a", {}, seed, status, metrics, {}, curves, "", {}, provenance)


def test_nan_is_the_worst_number_in_committed_and_new_trials_and_none_is_an_error() -> None:
    reads = ("metrics.score", "curves.fitness")
    committed = [record(seed, score=float(seed), environment_steps=5.0) for seed in range(10)]
    committed[9] = record(9, score=np.nan, environment_steps=np.nan)
    one = watched(("m", "a"), condition("m", "a", ()).condition, committed, (), lambda _: reads)
    assert one is not None
    assert one.values["score"] == (*range(9), -np.inf)
    assert one.values["mean fitness while training"][9] == -np.inf
    assert one.values["environment_steps"] == (5.0,) * 9 + (np.inf,)
    new = [record(10, score=np.nan, environment_steps=5.0), record(11, "diverged", score=1.0, environment_steps=5.0)]
    assert one.read(new) == {
        "score": (-np.inf,) * 2,
        "mean fitness while training": (-np.inf,) * 2,
        "environment_steps": (5.0, np.inf),
    }
    assert one.read([record(10, score=np.inf, environment_steps=1.0)])["mean fitness while training"] == (np.inf,)
    with pytest.raises(UserError, match="A new trial of m on a has no 'environment_steps'"):
        one.read([record(10, score=1.0)])
    with pytest.raises(UserError, match="A new trial of m on a has no 'mean fitness while training'"):
        one.read([record(10, environment_steps=1.0)])


def test_what_pilots_lack_is_watched_against_the_references_alone() -> None:
    rng = np.random.default_rng(0)
    made, reads = condition("m", "a", ()).condition, lambda _: ("metrics.score",)
    references = [record(seed, score=x, environment_steps=y) for seed, (x, y) in enumerate(normal(rng, n=(10, 2)))]
    pilot = [record(100 + seed, score=x) for seed, x in enumerate(normal(rng, n=50))]
    one, alone = (watched(("m", "a"), made, references, those, reads) for those in (pilot, ()))
    assert one is not None
    assert alone is not None
    assert {name: len(values) for name, values in one.values.items()} == {"score": 60, "environment_steps": 10}
    assert (one.whole, alone.whole) == (("score",), ("score", "environment_steps"))
    watch, scores = Watch("smoke", (one,)), iter(normal(rng, n=300).tolist())
    found: tuple[Night, ...] = ()
    for number in range(2):
        after = night(watch, number, lambda _: [next(scores) for _ in range(10)], before=found)
        found = (
            *found,
            structs.replace(after, values={"m on a": after.values["m on a"] | {"environment_steps": (9.0,) * 10}}),
        )
    paths = [_of_column(each, "environment_steps", found).tolist() for each in (one, alone)]
    assert paths[0] == paths[1]
    assert paths[0][1] > paths[0][0] > 50
    (family,) = watch.families
    assert family.path(found)[1] == pytest.approx(paths[0][1] / 8)
    without = Watch("smoke", (replace(one, values={"score": one.values["score"]}),)).families[0]
    assert family._of_sum(found).tolist() == without._of_sum(found).tolist()
    only = watched(("m", "a"), made, references, [record(100, other=1.0)], reads)
    assert only is not None
    assert (only.seeds, only.whole) == (alone.seeds, alone.whole)


def test_an_alarm_names_measures_and_versions_and_stays() -> None:
    rng = np.random.default_rng(0)
    watch = Watch("smoke", (condition("m", "a", normal(rng)), condition("m", "b", normal(rng))))
    series = nights(watch, 2, lambda _: normal(rng, n=10))
    assert watch.alarms(series) == {}
    shift = {"m on a": 3.0, "m on b": 0.0}
    for number in (2, 3, 4):
        after = night(watch, number, lambda label: normal(rng, shift[label], 10), "1.1", series)
        series = (*series, after)
    quiet = night(watch, 5, lambda _: normal(rng, n=10), "1.1", series)
    quiet = structs.replace(quiet, evidence={"m": 0.1})
    lines = watch.alarms((*series, quiet))["m"]
    assert lines[0].startswith("ALARM on 2026-01-0")
    assert lines[1].startswith("  moved: m on a: score is higher: median ")
    assert not any("m on b" in line for line in lines)
    assert lines[2:] == ["  versions against the committed trials: evosax 1 -> 1.1 since night 3"]
    moved = [structs.replace(one, device="cpu" if at < 1 else "gpu") for at, one in enumerate((*series, quiet))]
    assert watch.alarms(moved)["m"] == [*lines, "  device cpu -> gpu since night 2"]


def test_other_rules_begin_a_new_series_with_fresh_seeds() -> None:
    rng = np.random.default_rng(0)
    watch = Watch("smoke", (condition("m", "a", normal(rng)),))
    one = night(watch, 0, lambda _: normal(rng, n=10))
    assert watch.series([one]) == (one,)
    other = Watch("smoke", (*watch.conditions, condition("m", "b", normal(rng))))
    assert other.series([one]) == ()
    full = Watch("full", watch.conditions)
    assert full.series([one]) == ()
    between = structs.replace(night(full, 1, lambda _: normal(rng, n=10)), tier="full", series=2)
    assert (watch.series([one, between]), full.series([one, between])) == ((one,), (between,))
    assert [watch.first_fresh_seed(10_000, found) for found in ([], [one])] == [10_000, 10_010]
    assert watch.first_fresh_seed(0, []) == 150


@pytest.fixture
def written(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    watch = Watch("smoke", (condition('m"\\', "a ü", normal(rng)),))
    path = tmp_path / watch_file.FILE
    for one in nights(watch, 3, lambda _: [*normal(rng, n=8), -np.inf, 1e-12]):
        before, earlier = load(path)
        append(path, before, one)
        assert path.read_bytes().startswith(before)
        assert load(path)[1] == (*earlier, one)
    last = structs.replace(one, alarms=('a "line"',), restart=True)
    append(path.with_name("flagged.toml"), b"", last)
    assert load(path.with_name("flagged.toml"))[1] == (last,)
    return path


def test_a_file_that_was_edited_torn_or_shortened_is_refused(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    head, first, second, third = text.split("\n[[night]]\n")
    parts = [head, first, second, third]
    for damaged in (
        text.replace("2026-01-02", "2026-01-03"),
        text.replace("1e-12", "1e-13", 1),
        text[:-40],
        "\n[[night]]\n".join([head, second, third]),
        "\n[[night]]\n".join([head, first, third]),
        "\n[[night]]\n".join([*parts, third]),
        "\n[[night]]\n".join([head, second, first, third]),
        text.replace("schema = 1", "schema = 2"),
        "night = 3\nschema = 1\n",
        "schema = 1\nnight = [3]\n",
    ):
        assert damaged != text
        written.write_text(damaged, encoding="utf-8")
        with pytest.raises(UserError, match=r"watch\.toml is not as `evoclaims watch` wrote it: .*\. Restore the file"):
            load(written)


def test_whole_numbers_in_place_of_floats_break_no_seal(written: Path) -> None:
    before, nights = load(written)
    whole = structs.replace(nights[-1], level=20, values={"m": {"score": (1, 2)}}, evidence={"m": 1})
    append(written, before, whole)
    append(written, load(written)[0], nights[-1])
    assert load(written)[1] == (*nights, whole, nights[-1])
    written.write_text(written.read_text(encoding="utf-8").replace("level = 20.0", "level = 20"), encoding="utf-8")
    append(written, load(written)[0], whole)
    assert len(load(written)[1]) == 6


def test_a_night_is_not_added_to_a_file_that_has_changed_meanwhile(written: Path) -> None:
    before, (one, *_) = load(written)
    written.unlink()
    with pytest.raises(UserError, match="has changed during this night"):
        append(written, before, one)
    assert not written.exists()
