"""Where the neurons of a HyperNEAT network lie in the plane (Stanley, D'Ambrosio and Gauci 2009, §3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError, require_known

Point = tuple[float, float]
Extent = Literal["largest_layer", "unit"]


@dataclass(frozen=True)
class Substrate:
    """Layers of neurons in the plane, each fed by the whole layer before.

    Attributes:
        layers: the (x, y) of every neuron: inputs, with the bias last; hidden layers; outputs.
    """

    layers: tuple[tuple[Point, ...], ...]

    def __post_init__(self) -> None:
        """Check that inputs and outputs exist and every layer has neurons, each at a point."""
        if len(self.layers) < 2 or not all(self.layers):
            raise UserError(
                f"A substrate has layers of {tuple(map(len, self.layers))} neurons. Write at least a layer of "
                "inputs and one of outputs, and no empty layer."
            )
        for point in (point for layer in self.layers for point in layer):
            if len(point) != 2 or not all(map(math.isfinite, point)):
                raise UserError(f"A neuron of a substrate is at {point}. Write two finite coordinates.")

    @property
    def shapes(self) -> list[tuple[int, int]]:
        """The weight shapes [to, from] into each layer but the first."""
        return [(len(after), len(before)) for before, after in pairwise(self.layers)]

    @property
    def queries(self) -> NDArray[np.float32]:
        """The coordinates (x₁, y₁, x₂, y₂) of both ends of every connection, shape [connections, 4].

        Layer by layer; within a layer in weight order, row by row.
        """
        ends = [(*source, *target) for before, after in pairwise(self.layers) for target in after for source in before]
        return np.array(ends, np.float32)


def layered(widths: Sequence[int], extent: Extent = "largest_layer") -> Substrate:
    """Spread each layer evenly along x, and the layers evenly along y; a lone neuron lies in the middle.

    Args:
        widths: neurons per layer, the bias among the inputs.
        extent: both coordinates run from -1 to 1 ("unit"), or to ± the width of the largest layer ("largest_layer", as
            in the published code: most weights of a first population are then near their largest).

    Raises:
        UserError: for fewer than two layers, or an empty one.
    """
    require_known("extent of a substrate", extent, get_args(Extent))
    if len(widths) < 2 or min(widths) < 1:
        raise UserError(
            f"A substrate has layers of {tuple(widths)} neurons. Write at least two layers of at least one neuron each."
        )
    size = float(max(widths)) if extent == "largest_layer" else 1.0
    heights = _spread(len(widths), size)
    return Substrate(
        tuple(tuple((x, y) for x in _spread(width, size)) for width, y in zip(widths, heights, strict=True))
    )


def on_circle(angles: Sequence[float], radius: float = 1.0) -> tuple[Point, ...]:
    """Place neurons at these angles (radians, from the x-axis): where a robot's sensors or actuators point."""
    return tuple((radius * math.cos(angle), radius * math.sin(angle)) for angle in angles)


def _spread(count: int, size: float) -> list[float]:
    """Return `count` coordinates evenly from -size to size; 0 for a single one."""
    return [0.0] if count == 1 else [float(x) for x in np.linspace(-size, size, count)]
