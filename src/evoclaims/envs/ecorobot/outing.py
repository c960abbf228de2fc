"""What an episode carries from step to step, and what a task's rule says of one step."""

from __future__ import annotations

from typing import Any

from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.pytree import pytree
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.pose import Pose


@pytree
class Outing:
    """The inner state of an episode.

    Attributes:
        body: the moving state.
        pose: the torso's.
        time: environment steps made.
        memory: the rule's memory.
        effort: sum of the squared actions so far.
        overturned: steps spent upside-down.
    """

    body: Body
    pose: Pose
    time: Int[Array, ""]
    memory: Any
    effort: Float[Array, ""]
    overturned: Float[Array, ""]


@pytree
class Ruling:
    """The rule's result for one step.

    Attributes:
        memory: the rule's new memory.
        reward: of the step.
        ended: whether the task is over.
    """

    memory: Any
    reward: Float[Array, ""]
    ended: Bool[Array, ""]
