"""Mechanisms beside independent programs: Hansen's equations are within the claims' bands."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evoclaims.methods.mechanisms import Quadratic
from tests.methods.test_cma_es import Hansen

DIMENSIONS, POPULATION, GENERATIONS = 8, 16, 120


@pytest.mark.parametrize(
    ("condition", "falls", "conditions"), [(1.0, (0.18, 0.262), (1.9, 5.0)), (10_000.0, (0.13, 0.22), (2.0, 5.0))]
)
def test_hansens_equations_are_within_the_bands_of_k4_and_k5(
    condition: float, falls: tuple[float, float], conditions: tuple[float, float]
) -> None:
    task, found = Quadratic(condition=condition), []
    matrix = np.asarray(task.numbers, np.float64)

    def error(points: Any) -> Any:
        return np.sum(((points - task.optimum) @ matrix.T) ** 2, axis=-1) / 2

    for seed in range(20):
        draw, search, errors = np.random.default_rng(seed), Hansen(DIMENSIONS, POPULATION), []
        for _ in range(GENERATIONS):
            normal = draw.standard_normal((POPULATION, DIMENSIONS))
            population = search.mean + search.sigma * normal @ np.linalg.cholesky(search.C).T
            search.tell(population, error(population))
            errors.append(float(np.log(error(search.mean))))
        eigenvalues = np.linalg.eigvalsh(matrix @ search.C @ matrix.T)
        found.append(((errors[19] - errors[119]) / 100, eigenvalues[-1] / eigenvalues[0]))
    within = [falls[0] <= fall <= falls[1] and conditions[0] <= left <= conditions[1] for fall, left in found]
    assert np.mean(within) >= 0.9
    assert all(
        low < np.median(one) < high for (low, high), one in zip((falls, conditions), np.transpose(found), strict=True)
    )
