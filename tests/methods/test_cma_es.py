"""Hansen's own equations beside CMA-ES, ties included, and what it draws."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from evosax.algorithms.distribution_based.cma_es import CMA_ES
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Episode
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods import cma_es
from evoclaims.methods.cma_es import CmaEs
from evoclaims.networks.all_skips import AllSkips

pytestmark = pytest.mark.newest

DIMENSIONS, POPULATION = 5, 16
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Itself:
    """A network that answers with its parameters, so that a task is a plain function of them."""

    name: str = field(default="itself", init=False)

    def size(self, inputs: int, outputs: int) -> int:
        return outputs

    def apply(self, parameters: Any, observation: Any, outputs: int) -> Any:
        return parameters


@dataclass(frozen=True)
class Ellipsoid:
    """Minimize Σ condition^((i-1)/(n-1)) (x_i - optimum)²; what CMA-ES never calls is not here."""

    name: ClassVar[str] = "ellipsoid"
    levels: ClassVar[int] = 1
    observation_size: ClassVar[int] = 1
    horizon: ClassVar[int] = 1

    action_size: int = DIMENSIONS
    condition: float = 100.0
    optimum: float = 1.0

    def episode(self, policy: Any, key: Any, level: Any) -> Episode:
        scales = jnp.asarray(np.geomspace(1.0, self.condition, self.action_size), jnp.float32)
        error = jnp.sum(scales * (policy(jnp.zeros(1)) - self.optimum) ** 2)
        return Episode(fitness=-error, success=jnp.zeros(()))


class Hansen:
    """CMA-ES as Hansen 2016 prints it (Fig. 6, Table 1, Appendix A), in float64, on populations that it is given."""

    def __init__(self, n: int, population: int) -> None:
        self.n, self.mu, self.generation = n, population // 2, 0
        raw = np.log((population + 1) / 2) - np.log(np.arange(1, population + 1))  # (49)
        self.mu_eff = raw[: self.mu].sum() ** 2 / (raw[: self.mu] ** 2).sum()
        mu_eff_negative = raw[self.mu :].sum() ** 2 / (raw[self.mu :] ** 2).sum()
        self.c_1 = 2 / ((n + 1.3) ** 2 + self.mu_eff)  # (57)
        self.c_mu = min(1 - self.c_1, 2 * (self.mu_eff - 2 + 1 / self.mu_eff) / ((n + 2) ** 2 + self.mu_eff))  # (58)
        self.c_c = (4 + self.mu_eff / n) / (n + 4 + 2 * self.mu_eff / n)  # (56)
        self.c_sigma = (self.mu_eff + 2) / (n + self.mu_eff + 5)  # (55)
        self.d_sigma = 1 + 2 * max(0.0, np.sqrt((self.mu_eff - 1) / (n + 1)) - 1) + self.c_sigma
        alpha = min(  # (50), (51), (52)
            1 + self.c_1 / self.c_mu,
            1 + 2 * mu_eff_negative / (self.mu_eff + 2),
            (1 - self.c_1 - self.c_mu) / (n * self.c_mu),
        )
        self.weights = np.where(raw >= 0, raw / raw[raw > 0].sum(), alpha * raw / -raw[raw < 0].sum())  # (53)
        self.chi = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))
        self.mean, self.sigma, self.C = np.zeros(n), 1.0, np.eye(n)
        self.p_sigma, self.p_c, self.stalled = np.zeros(n), np.zeros(n), False

    def tell(self, population: Vector, error: Vector) -> None:
        """Update on a population that was drawn from N(mean, σ² C)."""
        n, c_c, c_sigma = self.n, self.c_c, self.c_sigma
        eigenvalues, basis = np.linalg.eigh(self.C)
        inverse_root = basis @ np.diag(eigenvalues**-0.5) @ basis.T
        y = (population[np.argsort(error, kind="stable")] - self.mean) / self.sigma
        y_w = self.weights[: self.mu] @ y[: self.mu]  # (41)
        self.mean = self.mean + self.sigma * y_w  # (42)
        self.p_sigma = (1 - c_sigma) * self.p_sigma + np.sqrt(c_sigma * (2 - c_sigma) * self.mu_eff) * (
            inverse_root @ y_w
        )  # (43)
        length = np.linalg.norm(self.p_sigma)
        self.sigma *= np.exp(c_sigma / self.d_sigma * (length / self.chi - 1))  # (44)
        self.generation += 1
        bound = (1.4 + 2 / (n + 1)) * self.chi * np.sqrt(1 - (1 - c_sigma) ** (2 * self.generation))
        self.stalled = bool(length >= bound)
        self.p_c = (1 - c_c) * self.p_c  # (45)
        if not self.stalled:
            self.p_c = self.p_c + np.sqrt(c_c * (2 - c_c) * self.mu_eff) * y_w
        squared = np.array([np.sum((inverse_root @ step) ** 2) for step in y])
        weights = np.where(self.weights >= 0, self.weights, self.weights * n / squared)  # (46)
        lost = self.stalled * c_c * (2 - c_c)
        self.C = (1 + self.c_1 * lost - self.c_1 - self.c_mu * self.weights.sum()) * self.C  # (47)
        self.C = self.C + self.c_1 * np.outer(self.p_c, self.p_c)
        self.C = self.C + self.c_mu * sum(w * np.outer(step, step) for w, step in zip(weights, y, strict=True))


def test_the_state_between_generations_holds_one_matrix(benches: dict[str, Any]) -> None:
    """A checkpoint is no larger than it needs to be: the eigenvectors follow from the covariance matrix."""
    bench = benches["cma_es"]
    state, _ = bench.run(2, seed=1)
    for distribution in (bench.init().distribution, state.distribution):
        size = distribution.mean.size
        assert sum(leaf.size for leaf in jax.tree.leaves(distribution)) < size**2 + 10 * size


def _watched_generation(method: Any, task: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a compiled (key, state) -> (state, progress, population, error): a step, and what evosax was told."""
    seen: list[Any] = []
    original = CMA_ES.tell

    def watched(self: Any, key: Any, population: Any, fitness: Any, state: Any, params: Any) -> Any:
        seen[:] = population, fitness
        return original(self, key, population, fitness, state, params)

    monkeypatch.setattr(CMA_ES, "tell", watched)

    @jax.jit
    def generation(key: Any, state: Any) -> tuple[Any, ...]:
        return *method.step(key, task, jnp.zeros((), jnp.int32), state), *seen

    return generation


def _generations_beside_the_tutorials(method: Any, task: Any, generations: int, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Check mean, σ, C and both paths after each generation; yield the tutorial's own state and what it was told."""
    size = method.network.size(task.observation_size, task.action_size)
    mine = Hansen(size, method.population)
    generation = _watched_generation(method, task, monkeypatch)
    state = method.init(jax.random.key(0), task)
    for number in range(generations):
        state, progress, population, error = generation(jax.random.key(number), state)
        assert progress.metrics["step_size"] == state.distribution.std
        mine.tell(np.asarray(population, np.float64), np.asarray(error, np.float64))
        theirs = state.distribution
        np.testing.assert_allclose(theirs.mean, mine.mean, atol=1e-4 * mine.sigma)
        np.testing.assert_allclose(theirs.std, mine.sigma, rtol=1e-4)
        np.testing.assert_allclose(theirs.C, mine.C, atol=1e-4 * np.abs(mine.C).max())
        np.testing.assert_allclose(theirs.p_std, mine.p_sigma, atol=1e-3)
        np.testing.assert_allclose(theirs.p_c, mine.p_c, atol=1e-3)
        yield mine, error


def test_on_a_smooth_function_every_generation_is_the_tutorials(monkeypatch: pytest.MonkeyPatch) -> None:
    """Same populations, separate states, whether or not h_σ stalls p_c.

    The optimum is so far away that σ has to grow first, which is when h_σ stalls.
    """
    method, task, stalls = CmaEs(POPULATION, Itself()), Ellipsoid(optimum=1e3), 0
    for mine, _ in _generations_beside_the_tutorials(method, task, 40, monkeypatch):
        stalls += mine.stalled
    assert 0 < stalls < 40
    assert np.linalg.cond(mine.C) > 10  # it has learnt something to be compared


def test_on_ties_at_the_smoke_tiers_size_every_generation_is_the_tutorials(monkeypatch: pytest.MonkeyPatch) -> None:
    """Same populations, separate states, 221 parameters and 256 individuals with a handful of fitness values."""
    method, task = CmaEs(256, AllSkips(16)), NParity(bits=4)
    for mine, error in _generations_beside_the_tutorials(method, task, 12, monkeypatch):
        assert mine.n == 221
        assert len(np.unique(error)) < 10
    assert abs(mine.sigma - 1) > 0.05


def test_at_the_papers_size_the_constants_are_those_of_an_independent_package() -> None:
    """From `cma` 4.4.0: CMAEvolutionStrategy(475 * [0], 1, {"popsize": 256}).

    Its c_σ has n + μ_eff + 3 for Hansen's n + μ_eff + 5, and its c_μ 1/4 more in the numerator: both half a per cent.
    From 4.4.4 on it has another damping, 2.41 here.
    """
    task = NParity(bits=6)
    method = CmaEs(256, AllSkips(24))
    assert method.network.size(task.observation_size, task.action_size) == 475
    _, ours = method._search(task)
    theirs = {
        "mu_eff": 66.85779557916017,
        "c_mean": 1.0,
        "c_std": 0.12637755417625496,
        "d_std": 1.1263775541762548,
        "c_c": 0.008639501415405277,
        "c_1": 8.813346841674727e-06,
        "c_mu": 0.0005722665898127517,
    }
    for name, value in theirs.items():
        np.testing.assert_allclose(getattr(ours, name), value, rtol=5e-3, err_msg=name)
    weights = np.asarray(ours.weights)
    np.testing.assert_allclose(weights[[0, -1]], [0.0387998095069943, -0.014198058841922212], rtol=1e-4)
    np.testing.assert_allclose(weights[128:].sum(), -1.0154007712464193, rtol=1e-4)


def test_individuals_are_drawn_with_the_mean_step_size_and_covariance_of_the_state(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    method, task = CmaEs(4096, Itself()), Ellipsoid()
    generation = _watched_generation(method, task, monkeypatch)
    state = method.init(jax.random.key(0), task)
    for number in range(12):
        before = state.distribution
        state, _, population, _ = generation(jax.random.key(number), state)
    steps = (np.asarray(population) - np.asarray(before.mean)) / float(before.std)
    assert np.linalg.cond(before.C) > 10
    root = np.linalg.cholesky(np.asarray(before.C, np.float64))
    white = np.linalg.solve(root, steps.T)
    np.testing.assert_allclose(white.mean(axis=1), 0, atol=5 / np.sqrt(4096))
    np.testing.assert_allclose(np.cov(white), np.eye(DIMENSIONS), atol=5 * np.sqrt(2 / 4096))


def test_a_population_too_small_to_recombine_is_one_sentence() -> None:
    with pytest.raises(UserError, match="CMA-ES has population=3. Write at least 4"):
        CmaEs(3)


@pytest.mark.parametrize(("large", "eigenvalues"), [(DIMENSIONS, "5"), (DIMENSIONS + 1, "4,5")], ids=["large", "small"])
def test_a_batch_of_large_matrices_is_decomposed_one_after_the_other(
    large: int, eigenvalues: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And otherwise as a batch; the generations are the same."""
    method: Any = CmaEs(POPULATION, Itself())  # type: ignore[arg-type]  # as much of a network as CMA-ES calls
    task: Any = Ellipsoid()

    def generation(key: Any, state: Any) -> Any:
        return method.step(key, task, jnp.zeros((), jnp.int32), state)[0]

    keys = jax.random.split(jax.random.key(3), 4)
    start = method.init(keys[0], task)
    states = jax.vmap(generation, (0, None))(keys, start)
    expected = jax.jit(jax.vmap(generation))(keys, states).distribution
    monkeypatch.setattr(cma_es, "LARGE", large)
    program = str(jax.make_jaxpr(jax.vmap(generation))(keys, states))
    assert re.findall(r"f32\[([\d,]+)\] = eigh", program) == [eigenvalues]
    found = jax.jit(jax.vmap(generation))(keys, states).distribution
    for name in ("mean", "std", "C"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-5)
