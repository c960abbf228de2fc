"""A capsule's contacts with a box: MJX's up to rounding, with about a seventh of its operations.

MJX has one function for capsules and all convex bodies. It clips the capsule's axis to the face that it is least deep
in, which makes two contacts, one at each end. Instead of both it takes one on the nearest edge, if the capsule is
beyond both faces there, and less deep.

Seen from the box all is simpler. The point centre + t · axis is between the two faces across x for t in an interval,
and so for y and z. Clipping keeps what is in two of the intervals. The nearest edge needs no search among twelve:
where a point is beyond two faces or three, an edge is the nearest of the whole box; no edge is nearer than the box;
and along the axis, the distance to the box has no minimum but the smallest. So there, and nowhere else, MJX can find
an edge that the capsule is beyond. The squared distance is Σₖ axisₖ² · (how far t is from the k-th interval)², which
gives the place of the minimum.

Two things differ. MJX finds points up to 5e-7 / half length short of the nearest. And where a capsule is parallel to
an edge and reaches beyond its end, three edges are as near: MJX takes one by rounding, and misses the contact if the
capsule is not beyond it.
"""

from __future__ import annotations

from typing import Final

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

LEVEL: Final = 1e-10
"""Where a component of the axis is smaller, it is taken for this: the interval is endless, or far away."""
SLACK: Final = 1e-6
"""MJX's, which draws the nearest point of an axis that is parallel to an edge towards the edge's middle; also the
squared distance below which an edge has no direction, hence no contact."""
TINY: Final = 1e-30
"""Instead of 0 in a denominator."""
STEEP: Final = 0.99
"""The cosine between the directions of an edge's and a face's contact from which on MJX prefers the face."""


def capsule_on_box(
    centre: Float[Array, " 3"],
    axis: Float[Array, " 3"],
    half_length: Float[Array, ""],
    radius: Float[Array, ""],
    box_place: Float[Array, " 3"],
    box_turn: Float[Array, "3 3"],
    box_size: Float[Array, " 3"],
) -> tuple[Float[Array, " 2"], Float[Array, "2 3"], Float[Array, "2 3"]]:
    """Return the distances (negative where they touch), places and normals (from capsule to box) of two contacts.

    Args:
        centre: of the capsule, in the world, as all of these.
        axis: its direction, of length 1.
        half_length: of its cylinder.
        radius: its.
        box_place: the box's centre.
        box_turn: the box's axes as columns.
        box_size: half-sizes.
    """
    centre, axis = (centre - box_place) @ box_turn, axis @ box_turn
    far, span = jnp.abs(centre), half_length * jnp.abs(axis)
    slope = jnp.where(jnp.abs(axis) < LEVEL, LEVEL, axis)
    per = 1 / (slope[0] * slope[2])  # one division for both; a planar robot's slope across y is known
    per = jnp.stack([per * slope[2], 1 / slope[1], per * slope[0]])
    middle, reach = -centre * per, box_size * jnp.abs(per)
    enter, leave = middle - reach, middle + reach

    # The face: the first of the highest in MJX's order, which begins with those across y and z.
    height = far - span - (box_size + radius)
    highest = jnp.max(height)
    on_x = height[0] > jnp.maximum(height[1], height[2])
    on_z = (height[2] > height[1]) & ~on_x
    on = jnp.stack([on_x, ~(on_x | on_z), on_z])
    ahead = jnp.stack([centre[0] >= 0, centre[1] > 0, centre[2] > 0])
    out = jnp.where(on, jnp.where(ahead, 1.0, -1.0), 0.0)
    sides, other = jnp.stack([on_x, on_z]), jnp.array([0, 2])
    first = jnp.maximum(-half_length, jnp.max(jnp.where(sides, enter[1], enter[other])))
    last = jnp.minimum(half_length, jnp.min(jnp.where(sides, leave[1], leave[other])))
    meets = (highest < 0) & (first <= last)
    ends = jnp.stack([jnp.minimum(first, half_length), jnp.maximum(last, -half_length)])
    rise = out @ axis
    face_gap = highest + half_length * jnp.abs(rise) + rise * ends
    face_place = centre[None] + jnp.outer(ends, axis) - jnp.outer(face_gap / 2 + radius, out)

    # The edge, if the capsule is beyond two faces where it is nearest to the box.
    along = _nearest(centre, axis, enter, leave, far + span > box_size)
    point = centre + jnp.clip(along, -half_length, half_length) * axis
    to_box = jnp.clip(point, -box_size, box_size) - point
    square = to_box @ to_box
    per_length = 1 / jnp.sqrt(jnp.maximum(square, SLACK))
    way, length = to_box * per_length, square * per_length
    x, y, z = to_box != 0
    near = ((x & y) | (z & (x | y))) & (square >= SLACK) & (length < radius)
    deepest = jnp.max(face_gap)
    rather_face = meets & (deepest < 0) & (length - radius <= deepest)
    edge = near & ~rather_face & ~(jnp.abs(way @ out) > STEEP)

    gap = jnp.where(meets, face_gap, 1.0)
    distance = jnp.stack([jnp.where(edge, length - radius, gap[0]), jnp.where(edge, 1.0, gap[1])])
    edge_place = point + (length + radius) / 2 * way
    place = jnp.stack([jnp.where(edge, edge_place, face_place[0]), face_place[1]])
    normal = jnp.stack([jnp.where(edge, way, -out), -out])
    return distance, box_place[None] + place @ box_turn.T, normal @ box_turn.T


def _nearest(
    centre: Float[Array, " 3"],
    axis: Float[Array, " 3"],
    enter: Float[Array, " 3"],
    leave: Float[Array, " 3"],
    leaves: Bool[Array, " 3"],
) -> Float[Array, ""]:
    """Return where a line is nearest to the box.

    If the intervals have no point in common, this is between the first that ends and the last that begins: nearer to
    the one with the larger weight, and drawn to the third, if it is not in it.

    Args:
        centre: a point of the line, seen from the box.
        axis: the line's direction, of length 1.
        enter: where the intervals begin.
        leave: where they end.
        leaves: whether the capsule's axis has points outside them.
    """
    weight = axis * axis
    ends, begins = jnp.min(leave), jnp.max(enter)
    one, other = (
        jnp.where(at[0], weight[0], jnp.where(at[2], weight[2], weight[1])) for at in (leave == ends, enter == begins)
    )
    nearest = jnp.clip((one * ends + other * begins) / jnp.maximum(one + other, TINY), enter, leave)
    # Parallel to an edge all points are as near; the middle of the edge decides instead of where it begins or ends.
    parallel = (weight > 0.5) & leaves[jnp.array([1, 2, 0])] & leaves[jnp.array([2, 0, 1])]
    drawn = jnp.sum(jnp.where(parallel, -SLACK * centre * axis, weight * nearest))
    settled = drawn / jnp.sum(jnp.where(parallel, SLACK, weight))
    return weight @ jnp.where(parallel, jnp.clip(settled, enter, leave), nearest)
