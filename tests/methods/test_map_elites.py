"""The archive against one kept by loops, what it leaves out, how its cells lie, and a plane that is explored."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plane import Plane
from small_methods import METHODS
from workbench import Workbench, same_bits

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Episode
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.map_elites import MapElites, lecun_uniform
from evoclaims.networks.mlp import Mlp

pytestmark = pytest.mark.newest

LEVEL = jnp.zeros((), jnp.int32)


SMALL = METHODS["map_elites"].method
# Its `usual_step` is used: with the fusions that conftest.py asks for, jax 0.10 makes a program that keeps no elite.
BENCH = Workbench(SMALL, METHODS["map_elites"].task)
X, Y = SMALL.cells  # told apart by their numbers
(X_MIN, X_MAX), (Y_MIN, Y_MAX) = Plane.area
WIDTH, HEIGHT = (X_MAX - X_MIN) / X, (Y_MAX - Y_MIN) / Y


def _episodes(rows: list[tuple[float, float, float]]) -> Episode:
    """Return episodes with the given fitness, x and y, and with their number as success."""
    fitness, x, y = np.array(rows, np.float32).T
    return Episode(fitness=fitness, success=np.arange(len(rows), dtype=np.float32), metrics={"x": x, "y": y})


def _population(first: int) -> Any:
    """Return genotypes that are all different: their number, and 100 times that, and so on."""
    size = SMALL.network.size(2, 2)
    return (first + np.arange(8, dtype=np.float32))[:, None] * np.arange(1, size + 1, dtype=np.float32)[None, :]


INSERT = jax.jit(lambda state, population, episodes: SMALL.insert(Plane(), state, population, episodes))

inside_x = st.builds(
    lambda i, part: X_MIN + WIDTH * (i + part), st.integers(0, X - 1), st.sampled_from([0.1, 0.5, 0.9])
)
inside_y = st.builds(lambda j, part: Y_MIN + HEIGHT * (j + part), st.integers(0, Y - 1), st.sampled_from([0.1, 0.9]))
nowhere = st.sampled_from([np.nan, np.inf, -np.inf, -1.01, 3.01, 1e9])
fitnesses = st.sampled_from([-1e3, -1.0, 0.0, 0.5, 2.0]) | st.sampled_from([np.nan, np.inf, -np.inf])
row = st.tuples(fitnesses, inside_x | nowhere, inside_y | nowhere) | st.tuples(
    st.sampled_from([-1.0, 0.5]), st.just(X_MIN + 0.1), st.just(Y_MIN + 0.1)
)
batch = st.lists(row, min_size=8, max_size=8)


@settings(max_examples=150, deadline=None)
@given(st.lists(batch, min_size=1, max_size=3))
def test_the_archive_is_the_one_that_loops_keep(batches: list[list[tuple[float, float, float]]]) -> None:
    state, mine = BENCH.init(), {}
    for number, rows in enumerate(batches):
        population = _population(10 * number)
        state = INSERT(state, population, _episodes(rows))
        for individual, (fitness, x, y) in enumerate(rows):
            if not (np.isfinite(fitness) and X_MIN <= x <= X_MAX and Y_MIN <= y <= Y_MAX):
                continue
            cell = int((x - X_MIN) // WIDTH), int((y - Y_MIN) // HEIGHT)
            if cell not in mine or fitness > mine[cell][0]:
                mine[cell] = fitness, x, y, individual, population[individual]
    state = jax.device_get(state)
    archive, table = state.archive, np.asarray(SMALL.fitness_map(state))
    assert {tuple(map(int, cell)) for cell in np.argwhere(table > -np.inf)} == mine.keys()
    for (i, j), (fitness, x, y, individual, genotype) in mine.items():
        place = j * X + i
        assert table[i, j] == archive.fitnesses[place, 0] == fitness
        np.testing.assert_allclose(archive.descriptors[place], [x, y], rtol=1e-6)
        assert archive.extra_scores["success"][place] == individual
        np.testing.assert_array_equal(archive.genotypes[place], genotype)


@pytest.mark.parametrize(
    ("x", "y", "cell"),
    [
        (X_MIN, Y_MIN, (0, 0)),
        (X_MAX, Y_MIN, (X - 1, 0)),
        (X_MIN, Y_MAX, (0, Y - 1)),
        (X_MAX, Y_MAX, (X - 1, Y - 1)),
        (X_MIN + 2.5 * WIDTH, Y_MIN + 0.5 * HEIGHT, (2, 0)),
        (X_MIN + 0.5 * WIDTH, Y_MIN + 1.5 * HEIGHT, (0, 1)),
    ],
)
def test_the_map_counts_x_first_and_the_areas_border_belongs_to_it(x: float, y: float, cell: tuple[int, int]) -> None:
    state = INSERT(BENCH.init(), _population(1), _episodes([(1.0, x, y)] * 8))
    assert SMALL.fitness_map(state).shape == (X, Y)
    assert np.argwhere(np.asarray(SMALL.fitness_map(state)) > -np.inf).tolist() == [list(cell)]


def _centre(i: int, j: int) -> tuple[float, float]:
    return X_MIN + WIDTH * (i + 0.5), Y_MIN + HEIGHT * (j + 0.5)


@pytest.mark.parametrize(
    ("cells", "elites", "covered"),
    [
        ([(0, 0), (3, 2), (1, 0), (1, 0)], 3, 3),
        ([(0, 1), (0, 2), (2, 1)], 3, 1),  # the upper cells of the leftmost column cannot be reached
        ([(1, 0), (2, 0)], 2, 2),  # with x and y exchanged the first of them could not
        ([(i, j) for i in range(X) for j in range(Y)], X * Y, X * Y - 2),
    ],
)
def test_coverage_is_the_share_of_reachable_cells_that_hold_an_elite(
    cells: list[tuple[int, int]], elites: int, covered: int
) -> None:
    rows, state = [(1.0, *_centre(*cell)) for cell in cells], BENCH.init()
    for batch in (rows[:8], rows[8:]):
        state = INSERT(state, _population(1), _episodes(batch + [(np.nan, *_centre(3, 1))] * (8 - len(batch))))
    _, (progress,) = FROZEN.run(1, state=state)
    assert float(progress.metrics["elites"]) == elites
    assert float(progress.metrics["coverage"]) == np.float32(covered / (X * Y - 2))


class _Frozen(Plane):
    """A plane on which whatever is evaluated now is invalid."""

    def episode(self, policy: Any, key: Any, level: Any) -> Episode:
        return replace(super().episode(policy, key, level), fitness=jnp.array(jnp.nan))


FROZEN = Workbench(SMALL, _Frozen())


def test_what_is_invalid_stays_out_and_an_empty_archive_says_so() -> None:
    state, reports = FROZEN.run(2)
    assert float(reports[-1].fitness) == np.finfo(np.float32).min  # -inf would end the trial as diverged
    assert float(reports[-1].metrics["elites"]) == 0
    assert float(reports[-1].metrics["reached"]) == 0.0
    assert np.isfinite(SMALL.best(FROZEN.task, state)(jnp.ones(2))).all()


def test_every_elite_does_what_the_archive_says_of_it() -> None:
    method = replace(SMALL, cells=(12, 9), batch=32)
    state, reports = Workbench(method, Plane()).run(30)
    archive, table = state.archive, np.asarray(method.fitness_map(state))
    again = jax.vmap(
        lambda p: Plane().episode(lambda seen: method.network.apply(p, seen, 2), jax.random.key(0), LEVEL)
    )(archive.genotypes)
    filled = np.flatnonzero(np.asarray(archive.fitnesses[:, 0]) > -np.inf)
    assert len(filled) == int(reports[-1].metrics["elites"]) > 20
    places = np.stack([again.metrics["x"], again.metrics["y"]], axis=-1)
    np.testing.assert_allclose(archive.descriptors[filled], places[filled], atol=1e-4)
    np.testing.assert_allclose(archive.fitnesses[filled, 0], again.fitness[filled], atol=1e-4)
    for at in filled:
        x, y = np.asarray(archive.descriptors[at], np.float64)
        i, j = min(int((x + 1.0) / 4.0 * 12), 11), min(int((y - 0.5) / 1.5 * 9), 8)
        assert table[i, j] == archive.fitnesses[at, 0]


def test_no_elite_is_ever_lost_or_worsened_and_the_fittest_is_the_best_policy() -> None:
    state, before, gains = BENCH.init(), np.full((X, Y), -np.inf), []
    for number in range(25):
        state, progress = BENCH.usual_step(jax.random.key(number), LEVEL, state)
        table = np.asarray(SMALL.fitness_map(state))
        assert (table >= before).all()
        assert float(progress.fitness) == table.max()
        examined = BENCH.examine(state)
        np.testing.assert_allclose(float(examined.fitness), table.max(), atol=1e-5)
        assert float(examined.success) == float(progress.success)
        gains.append(table.max() - before.max())
        before = table
    assert max(gains[1:]) > 0


def test_the_champion_carries_the_map_and_acts_by_its_vector_alone() -> None:
    state, _ = BENCH.run(5, usual=True)
    policy = SMALL.best(Plane(), state)
    vector, table = policy.parameters
    assert same_bits(table, SMALL.fitness_map(state))
    seen = jnp.array([0.3, -0.7])
    assert same_bits(policy(seen), SMALL.network.apply(vector, seen, 2))
    assert same_bits(replace(policy, parameters=(vector, table * jnp.nan))(seen), policy(seen))
    assert not same_bits(replace(policy, parameters=(vector / 2, table))(seen), policy(seen))


def test_the_far_corner_is_found_by_variation_and_not_without() -> None:
    """In twelve steps the point gets there only by going right nearly at full speed, as no first network does."""
    task = Plane(horizon=12, stride=0.36)
    method = replace(SMALL, network=Mlp((8,)), batch=32, cells=(20, 10), iso_sigma=0.05, line_sigma=0.1)
    _, reports = Workbench(method, task).run(200)
    sticky = [float(progress.metrics["reached"]) for progress in reports]
    assert sticky == sorted(sticky)
    assert sticky[0] == 0.0
    assert sticky[-1] == 1.0
    assert float(reports[-1].metrics["coverage"]) > 0.5
    still = replace(method, iso_sigma=1e-6, line_sigma=0.0)
    _, control = Workbench(still, task).run(200)
    assert float(control[-1].metrics["reached"]) == 0.0
    assert float(control[-1].metrics["coverage"]) < 0.2


def _batches(
    method: MapElites, state: Any, monkeypatch: pytest.MonkeyPatch, steps: int = 1, seed: int = 0
) -> list[Any]:
    """Take steps; return the batches that were evaluated."""
    seen: list[Any] = []
    original = MapElites.insert

    def watched(self: Any, task: Any, state: Any, population: Any, episodes: Any) -> Any:
        seen.append(population)
        return original(self, task, state, population, episodes)

    @jax.jit
    def step(key: Any, state: Any) -> Any:
        following, _ = method.step(key, Plane(), LEVEL, state)
        return following, seen.pop()

    monkeypatch.setattr(MapElites, "insert", watched)
    batches = []
    for number in range(steps):
        state, batch = step(jax.random.key(seed + number), state)
        batches.append(np.asarray(batch))
    return batches


def test_the_first_batches_are_drawn_anew_and_the_next_vary_elites(monkeypatch: pytest.MonkeyPatch) -> None:
    method = replace(SMALL, initial=9, iso_sigma=1e-5, line_sigma=0.0)
    first, second, third = _batches(method, method.init(jax.random.key(0), Plane()), monkeypatch, steps=3)

    def nearest(batch: Any) -> Any:
        return np.array([np.abs(earlier - one).max(axis=1).min() for one in batch])

    earlier = first
    assert nearest(second).min() > 1e-2
    earlier = np.concatenate([first, second])
    assert nearest(third).max() < 1e-4
    assert len(np.unique(third, axis=0)) == len(third)


def test_offspring_of_a_lone_elite_are_it_and_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    method = replace(SMALL, batch=400, iso_sigma=0.03, line_sigma=0.5)
    rows = [(1.0, *_centre(1, 1))] * 8
    state = replace(INSERT(BENCH.init(), _population(1), _episodes(rows)), evaluated=jnp.array(8, jnp.int32))
    (children,) = _batches(method, state, monkeypatch)
    noise = children - np.asarray(_population(1)[0])
    assert np.std(noise) == pytest.approx(0.03, rel=0.05)
    assert abs(np.mean(noise)) < 0.002
    (others,) = _batches(method, state, monkeypatch, seed=1)
    assert abs(np.corrcoef(noise.ravel(), (others - np.asarray(_population(1)[0])).ravel())[0, 1]) < 0.05


def test_offspring_of_two_elites_lie_on_the_line_through_them(monkeypatch: pytest.MonkeyPatch) -> None:
    method = replace(SMALL, batch=2000, iso_sigma=0.0, line_sigma=0.05)
    rows = [(1.0, *_centre(1, 1)), (1.0, *_centre(2, 1))] + [(np.nan, 0.0, 0.0)] * 6
    state = replace(INSERT(BENCH.init(), _population(1), _episodes(rows)), evaluated=jnp.array(8, jnp.int32))
    (children,) = _batches(method, state, monkeypatch)
    one, other = np.asarray(_population(1)[:2])
    along = (children - one) @ (other - one) / np.sum((other - one) ** 2)
    np.testing.assert_allclose(children, one + along[:, None] * (other - one), atol=1e-3)
    from_parent = np.where(np.abs(along) < 0.5, along, 1 - along)
    # Half of the pairs are an elite with itself, and stay where they are.
    moved = np.abs(from_parent) > 1e-4
    assert np.mean(moved) == pytest.approx(0.5, abs=0.06)
    assert np.std(from_parent[moved]) == pytest.approx(0.05, rel=0.1)
    assert np.mean(along > 0.5) == pytest.approx(0.5, abs=0.06)


@pytest.mark.parametrize("skip", [False, True])
def test_drawn_networks_have_lecuns_weights_and_no_biases(skip: bool) -> None:
    network, count = Mlp((5, 3), skip=skip), 2000
    drawn = np.asarray(lecun_uniform(jax.random.key(0), network, 7, 2, count))
    assert drawn.shape == (count, network.size(7, 2))
    start = 0
    for fan_in, feeding, fan_out in ((7, 7, 5), (5, 5, 3), (3, 3 + 7 * skip, 2)):
        weights = drawn[:, start : start + fan_in * fan_out]
        biases = drawn[:, start + fan_in * fan_out : start + (fan_in + 1) * fan_out]
        np.testing.assert_allclose(weights.std(axis=0), feeding**-0.5, rtol=0.08)
        assert np.abs(weights).max() <= (3 / feeding) ** 0.5
        assert not biases.any()
        start += (fan_in + 1) * fan_out
    if skip:
        np.testing.assert_allclose(drawn[:, start:].std(axis=0), 10**-0.5, rtol=0.08)
    else:
        assert start == drawn.shape[1]


class _Moved(Plane):
    """A plane of two levels: success is to end at the left on the first, and nowhere on the second."""

    levels: ClassVar[int] = 2

    def episode(self, policy: Any, key: Any, level: Any) -> Episode:
        one = super().episode(policy, key, level)
        return replace(
            one, fitness=one.fitness - jnp.where(level == 0, 0.0, 10.0), success=jnp.where(level == 0, 1.0, 0.0)
        )


def test_nothing_of_another_level_is_told_or_kept() -> None:
    """The archive held elites of the level before, whose success was told as that of this one: it counted as solved."""
    bench = Workbench(SMALL, _Moved())
    state, (*_, first) = bench.run(4)
    assert (float(first.success), int(state.level)) == (1.0, 0)
    after, (second,) = bench.run(1, state=state, level=1)
    assert (float(second.success), int(after.level)) == (0.0, 1)
    assert float(second.fitness) < -5.0
    held = np.asarray(after.archive.fitnesses)
    assert np.isfinite(held).any()
    assert (held < -5.0).all()
    assert bench.run(2, state=after, level=1)[1][-1].metrics["elites"] >= second.metrics["elites"]
    assert Workbench(SMALL, Plane()).init().level is None


class _Blind(Plane):
    """A plane whose episodes do not tell where they ended."""

    def episode(self, policy: Any, key: Any, level: Any) -> Episode:
        return replace(super().episode(policy, key, level), metrics={"distance": jnp.zeros(())})


def test_a_task_that_cannot_be_mapped_is_one_sentence() -> None:
    with pytest.raises(UserError, match="'n_parity' has no area to map. Use a task with `area` and `reachable`"):
        SMALL.init(jax.random.key(0), NParity(3))
    with pytest.raises(UserError, match=r'metrics "x" and "y", which \'plane\' lacks \(it has: distance\)'):
        Workbench(SMALL, _Blind()).run(1)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"batch": 0}, "MAP-Elites's batch must be at least 1, not 0"),
        ({"initial": 0}, "MAP-Elites's initial must be at least 1, not 0"),
        ({"cells": (5,)}, "MAP-Elites has cells=(5,). Write two numbers of at least 1."),
        ({"cells": (5, 0)}, "MAP-Elites has cells=(5, 0)."),
        ({"iso_sigma": -0.1}, "iso_sigma=-0.1 and line_sigma=0.2"),
        ({"line_sigma": float("nan")}, "iso_sigma=0.2 and line_sigma=nan"),
        ({"iso_sigma": 0.0, "line_sigma": 0.0}, "one of them above 0"),
    ],
)
def test_a_wrong_hyperparameter_is_one_sentence(wrong: dict[str, Any], sentence: str) -> None:
    with pytest.raises(UserError) as told:
        replace(SMALL, **wrong)
    assert sentence in str(told.value)
