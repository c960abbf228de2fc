"""Robots: a MuJoCo model and what a task must know about it. A new robot is an XML file and one entry below."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from importlib import resources
from typing import Final

from evoclaims.core.errors import UserError

OURS: Final = "evoclaims.envs.ecorobot:assets/"
BRAX: Final = "brax:envs/assets/"


@dataclass(frozen=True)
class Robot:
    """A body, with the numbers of its locomotion task in Brax.

    Attributes:
        name: the registered name.
        xml: the model, "package:path". Its first body is the torso, whose joints move the robot through the world.
        frames: simulation steps in one environment step.
        torso_radius: where range sensors sit, m from the torso's centre.
        forward_reward: for each m/s of forward velocity, in every step.
        control_cost: paid in every step, times the sum of the squared actions.
        healthy_reward: earned in every step in which the robot is healthy.
        healthy_height: lowest and highest z of a healthy torso, m.
        healthy_pitch: largest pitch of a healthy torso to either side, rad; only for planar robots.
        start: the start configuration, if not the model's own.
        position_noise, velocity_noise: at starts: half-width of a uniform distribution, scale of a normal one (uniform
            for robots that Brax starts so).
        normal_velocity: whether start velocities are normally, not uniformly, distributed.
        scales_actions: whether an action in [-1, 1] spans the motors' whole range, as for Brax's humanoid; otherwise
            motors take it unscaled, clipped to their range.
        free_coordinates: leading positions that give its place in the world; plain locomotion does not show them.
        seen_velocities: how many velocities a policy sees, from the first; None for all.
        velocity_limit: shown velocities are clipped to it.
        contacts: most contacts kept, the nearest ones.
        touching: contacts of which seldom more touch at a time. Steps with more take longer; results are the same.
    """

    name: str
    xml: str
    frames: int = 5
    torso_radius: float = 0.25
    forward_reward: float = 1.0
    control_cost: float = 0.0
    healthy_reward: float = 0.0
    healthy_height: tuple[float, float] = (-math.inf, math.inf)
    healthy_pitch: float = math.inf
    start: tuple[float, ...] | None = None
    position_noise: float = 0.1
    velocity_noise: float = 0.1
    normal_velocity: bool = True
    scales_actions: bool = False
    free_coordinates: int = 1
    seen_velocities: int | None = None
    velocity_limit: float = math.inf
    contacts: int = 8
    touching: int = field(default=4, metadata={"canonical": False})

    @property
    def file(self) -> str:
        """The path of the model's file.

        Raises:
            UserError: when there is no such package, or no such file in it.
        """
        package, _, path = self.xml.partition(":")
        try:
            found = resources.files(package) / path
        except (ImportError, TypeError, ValueError) as error:
            raise UserError(
                f"The robot {self.name!r} has its model in {self.xml!r}, and there is no package {package!r}: write "
                "PACKAGE:PATH, of a package that can be imported."
            ) from error
        if not found.is_file():
            raise UserError(f"The robot {self.name!r} has its model in {self.xml!r}, and there is no file {found}.")
        return str(found)


SIMPLE_ROB: Final = Robot(
    "simple_rob",
    OURS + "simple_rob.xml",
    torso_radius=0.2,
    free_coordinates=2,
    seen_velocities=2,
    contacts=2,
    touching=1,
)
ANT: Final = Robot(
    "ant",
    BRAX + "ant.xml",
    control_cost=0.5,
    healthy_reward=1.0,
    healthy_height=(0.2, 1.0),
    free_coordinates=2,
    start=(0.0, 0.0, 0.55, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0),
)
HALF_CHEETAH: Final = Robot("half_cheetah", BRAX + "half_cheetah.xml", torso_radius=0.05, control_cost=0.1, touching=3)
HOPPER: Final = Robot(
    "hopper",
    BRAX + "hopper.xml",
    frames=4,
    torso_radius=0.05,
    control_cost=1e-3,
    healthy_reward=1.0,
    healthy_height=(0.7, math.inf),
    healthy_pitch=0.2,
    position_noise=5e-3,
    velocity_noise=5e-3,
    normal_velocity=False,
    velocity_limit=10.0,
)
HUMANOID: Final = Robot(
    "humanoid",
    BRAX + "humanoid.xml",
    torso_radius=0.1,
    forward_reward=1.25,
    control_cost=0.1,
    healthy_reward=5.0,
    healthy_height=(1.0, 2.0),
    position_noise=1e-2,
    velocity_noise=1e-2,
    normal_velocity=False,
    scales_actions=True,
    free_coordinates=2,
)
WALKER2D: Final = replace(
    HOPPER, name="walker2d", xml=BRAX + "walker2d.xml", healthy_height=(0.8, 2.0), healthy_pitch=1.0
)

ROBOTS: Final = {robot.name: robot for robot in (SIMPLE_ROB, ANT, HALF_CHEETAH, HOPPER, HUMANOID, WALKER2D)}
