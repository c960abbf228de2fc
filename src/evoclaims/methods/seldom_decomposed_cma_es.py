"""CMA-ES for networks of thousands of parameters: its covariance matrix is decomposed only now and then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from evoclaims.core.errors import UserError
from evoclaims.core.foreign import Later
from evoclaims.methods.cma_es import CmaEs

aging_cma_es = Later("evoclaims.methods.aging_cma_es")


@dataclass(frozen=True)
class SeldomDecomposedCmaEs(CmaEs):
    """CMA-ES that samples with the covariance matrix of some generations ago.

    The time of an eigendecomposition grows with the cube of the number n of parameters, and a generation changes a
    large matrix little: the learning rates c_1 + c_μ fall with n² (Hansen 2016, Eqs. 57 and 58). Hansen's
    implementations decompose it again when generations have replaced a share of 0.1 / n of it (ibid., §B.2). That is
    every third generation for 3,425 parameters and 256 individuals, whose generations replace 1e-5 of it.

    Attributes:
        population: individuals per generation (λ).
        network: the policy's network, whose parameters are evolved.
        replaced: share of the matrix that generations replace, Σ (c_1 + c_μ), before it is decomposed again. With 0
            it is decomposed in every generation, as by `CmaEs`.
    """

    name: ClassVar[str] = "seldom_decomposed_cma_es"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("evosax", "flax")

    replaced: float = 0.01

    def __post_init__(self) -> None:
        """Check the population size and the share."""
        super().__post_init__()
        if not 0.0 <= self.replaced < 1.0:
            raise UserError(
                f"SeldomDecomposedCmaEs has replaced={self.replaced}, a share of the covariance matrix. Write a "
                "number from 0 to below 1."
            )

    def _kept(self, distribution: Any) -> Any:
        """Return all of it: the next generations sample with these eigenvectors."""
        return distribution

    @property
    def _algorithm(self) -> Callable[..., Any]:
        """Return what makes the search."""
        return partial(aging_cma_es.AgingCmaEs, self.replaced)
