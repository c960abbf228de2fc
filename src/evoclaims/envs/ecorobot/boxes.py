"""Boxes: the walls and obstacles of the tasks' worlds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError


@dataclass(frozen=True)
class Surface:
    """How hard and how rough a box is, by MuJoCo's numbers for contacts; the defaults are MuJoCo's.

    Attributes:
        friction: sliding, torsional and rolling; of two surfaces that touch, the larger counts.
        solref, solimp: stiffness and damping; of two surfaces that touch, the mean.
    """

    friction: tuple[float, float, float] = (1.0, 0.005, 0.0001)
    solref: tuple[float, float] = (0.02, 1.0)
    solimp: tuple[float, float, float, float, float] = (0.9, 0.95, 0.001, 0.5, 2.0)

    def __post_init__(self) -> None:
        """Check its numbers: MuJoCo takes NaN, and a trial would only diverge."""
        parts = self.friction, self.solref, self.solimp
        numbers = [number for part in parts for number in part]
        if tuple(map(len, parts)) != (3, 2, 5) or not all(map(math.isfinite, numbers)) or min(self.friction) < 0:
            raise UserError(
                f"{self} is not valid. Write three frictions of at least 0, two numbers of solref and five of "
                "solimp, all finite."
            )


@dataclass(frozen=True)
class Box:
    """A fixed box in the world: a wall, or an obstacle.

    Attributes:
        centre: x and y, m.
        half_size: along its axis and across, m.
        angle: its axis, counterclockwise from +x, degrees.
        bottom, top: z, m.
        surface: how it meets what touches it.
    """

    centre: tuple[float, float]
    half_size: tuple[float, float]
    angle: float = 0.0
    bottom: float = -0.7
    top: float = 0.7
    surface: Surface = Surface()

    def __post_init__(self) -> None:
        """Check that it has a volume."""
        numbers = (*self.centre, *self.half_size, self.angle, self.bottom, self.top)
        if not all(map(math.isfinite, numbers)) or min(self.half_size) <= 0 or self.bottom >= self.top:
            raise UserError(
                f"{self} is not valid. Write finite numbers, half sizes above 0, and a bottom below its top."
            )

    @property
    def place(self) -> tuple[float, float, float]:
        """Its centre in space, m."""
        return (*self.centre, (self.bottom + self.top) / 2)

    @property
    def size(self) -> tuple[float, float, float]:
        """Half-sizes along its axis, across, and up, m."""
        return (*self.half_size, (self.top - self.bottom) / 2)

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Its axes as columns, shape [3, 3]."""
        cosine, sine = math.cos(math.radians(self.angle)), math.sin(math.radians(self.angle))
        return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])

    @property
    def corners(self) -> NDArray[np.float64]:
        """Its corners seen from above, shape [4, 2], m."""
        signs = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
        return np.array(self.centre) + (signs * self.half_size) @ self.rotation[:2, :2].T

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of ground points, shape [..., 2], from it, seen from above, m; 0 inside."""
        local = (points - np.array(self.centre)) @ self.rotation[:2, :2]
        outside = np.maximum(np.abs(local) - np.array(self.half_size), 0.0)
        distance: NDArray[np.float64] = np.hypot(outside[..., 0], outside[..., 1])
        return distance
