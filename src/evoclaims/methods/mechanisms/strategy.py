"""CMA-ES on quadratic functions: does it learn the covariance, and does its distance fall as fast as it should?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray
from numpy.typing import NDArray

from evoclaims.envs.base import Episode, Task
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.mechanisms.observed import Observed, Question


@dataclass(frozen=True)
class Itself:
    """A network that answers with its parameters, so that fitness is a function of these."""

    name: str = field(default="itself", init=False)

    def size(self, inputs: int, outputs: int) -> int:
        """Return the number of outputs."""
        return outputs

    def apply(
        self, parameters: Float[Array, " parameters"], observation: Float[Array, " inputs"], outputs: int
    ) -> Float[Array, " outputs"]:
        """Return the parameters."""
        return parameters


@dataclass(frozen=True)
class Quadratic(Question):
    """Minimize |A (x - optimum)|² / 2: a sphere, or an ellipsoid in a basis that no axis is parallel to.

    The function is a number of the task, so that all of one size compile once.

    Attributes:
        action_size: dimensions.
        condition: of the Hessian AᵀA; 1 is a sphere.
        optimum: in every coordinate.
        axes: A, if a program takes it as data.
    """

    name: ClassVar[str] = "quadratic"
    packages: ClassVar[tuple[str, ...]] = CmaEs.packages

    action_size: int = 8
    condition: float = 1.0
    optimum: float = 1.0
    axes: Any = field(default=None, compare=False, repr=False, kw_only=True, metadata={"canonical": False})

    @cached_property
    def numbers(self) -> NDArray[np.float32]:
        """A, shape [dimensions, dimensions]."""
        basis, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((self.action_size, self.action_size)))
        scales = np.geomspace(1.0, self.condition**0.5, self.action_size)
        axes: NDArray[np.float32] = (scales[:, None] * basis.T).astype(np.float32)
        return axes

    def with_numbers(self, numbers: Any) -> Quadratic:
        """Return the task with this A."""
        return Quadratic(self.action_size, self.condition, self.optimum, axes=numbers)

    @property
    def matrix(self) -> Float[Array, "dimensions dimensions"]:
        """A."""
        return jnp.asarray(self.numbers if self.axes is None else self.axes)

    def scored(self, answer: Float[Array, " action"]) -> Episode:
        """Return minus the function."""
        return Episode(fitness=-jnp.sum((self.matrix @ (answer - self.optimum)) ** 2) / 2, success=jnp.zeros(()))


@dataclass(frozen=True)
class CmaEsMechanisms(Observed):
    """CMA-ES whose distribution is compared with the function that it minimizes.

    Metrics: "condition" of the covariance in the coordinates in which the function is a sphere (1 once all is learnt),
    "log_error", the logarithm of the function at the mean.
    """

    of: CmaEs = CmaEs(population=16, network=Itself())

    def seen(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], before: Any, after: Any
    ) -> Mapping[str, Float[Array, ""]]:
        """Compare the distribution after the step with the function."""
        assert isinstance(task, Quadratic)
        covariance = task.matrix @ after.distribution.C @ task.matrix.T
        eigenvalues = jnp.linalg.eigvalsh((covariance + covariance.T) / 2)
        error = -task.scored(after.distribution.mean).fitness
        return {"condition": eigenvalues[-1] / jnp.maximum(eigenvalues[0], 1e-30), "log_error": jnp.log(error + 1e-30)}
