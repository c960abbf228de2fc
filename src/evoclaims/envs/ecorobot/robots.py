"""Robots: a MuJoCo model and what a task must know about it. A new robot is an XML file and one entry below."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Final

import mujoco
import numpy as np

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot import model_files
from evoclaims.envs.ecorobot.features import require_simulated
from evoclaims.envs.ecorobot.model_files import BRAX, OURS


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
        touching: how many contacts touch at a time in most steps. Steps with more take longer, with the same results.
            Where each limb has places of its own (an ant), only whether it is below `contacts` matters.
        body: a hash of what it is made of, part of its trials' ids; None for the built-in robots, whose files stay.

    A built-in robot's file is simulated as the paper's code does: one iteration of the solver, explicit damping. Any
    other is simulated as it says, or refused.
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
    body: str | None = field(init=False, default=None, repr=False, metadata={"canonical": "if set"})

    def __post_init__(self) -> None:
        """Check the numbers and the model, and name what it is made of: with an edited file it is another robot.

        Raises:
            UserError: when there is no such file, it is no model that can be simulated, or the numbers do not fit.
        """
        self._require_numbers()
        if self.is_built_in:
            return
        model = model_files.own_model(self.name, self.xml)
        require_simulated(self.name, model)
        self.require_fit(model)
        object.__setattr__(self, "body", model_files.body_hash(model))

    def require_fit(self, model: mujoco.MjModel) -> None:
        """Check the numbers that depend on the robot's model.

        Raises:
            UserError: naming the number.
        """
        sizes = {
            "free_coordinates": (self.free_coordinates, model.nq),
            "seen_velocities": (self.seen_velocities, model.nv),
        }
        for name, (given, most) in sizes.items():
            if given is not None and given > most:
                raise UserError(
                    f"The robot {self.name} has {name}={given}, but its model has {most}. Write at most {most}."
                )
        if self.start is not None:
            if len(self.start) != model.nq:
                raise UserError(
                    f"The robot {self.name} has a start of {len(self.start)} positions, but its model has "
                    f"{model.nq}. Write {model.nq} numbers."
                )
            for joint in np.flatnonzero(
                np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL))
            ):
                at = model.jnt_qposadr[joint] + 3 * (model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE)
                if not any(self.start[at : at + 4]):
                    raise UserError(
                        f"The robot {self.name} starts with the orientation 0 0 0 0 (positions {at} to {at + 3}), "
                        "which is not a rotation. Write 1 0 0 0 for upright."
                    )
        low, high = model.actuator_ctrlrange.T
        if self.scales_actions and not np.all(low < high):
            motor = model.actuator(int(np.argmin(low < high)))
            raise UserError(
                f"The robot {self.name} has scales_actions=True, but its actuator {motor.name or motor.id} has the "
                f"ctrlrange {motor.ctrlrange[0]:g} {motor.ctrlrange[1]:g}, which is empty. Write a ctrlrange whose "
                "first number is below its second, or leave out scales_actions."
            )

    def _require_numbers(self) -> None:
        """Check types, signs and order of what does not depend on the model."""
        for name in ("name", "xml"):
            if not isinstance(getattr(self, name), str) or not getattr(self, name):
                raise UserError(f"A robot has {name}={getattr(self, name)!r}. Write text that is not empty.")
        least = {"frames": 1, "contacts": 1, "touching": 0, "free_coordinates": 0, "seen_velocities": 0}
        for name, lowest in least.items():
            given = getattr(self, name)
            if given is None and name == "seen_velocities":
                continue
            if not isinstance(given, int) or isinstance(given, bool) or given < lowest:
                raise UserError(
                    f"The robot {self.name} has {name}={given!r}. Write a whole number of at least {lowest}."
                )
        for name in ("normal_velocity", "scales_actions"):
            if not isinstance(getattr(self, name), bool):
                raise UserError(f"The robot {self.name} has {name}={getattr(self, name)!r}. Write True or False.")
        signed_ones = ("forward_reward", "control_cost", "healthy_reward")
        for name in ("torso_radius", *signed_ones, "position_noise", "velocity_noise"):
            given, signed = getattr(self, name), name in signed_ones
            if not _is_number(given) or math.isinf(given) or (given < 0 and not signed):
                allowed = "a finite number" if signed else "a finite number of at least 0"
                raise UserError(f"The robot {self.name} has {name}={given!r}. Write {allowed}.")
        for name in ("healthy_pitch", "velocity_limit"):
            given = getattr(self, name)
            if not _is_number(given) or given <= 0:
                raise UserError(f"The robot {self.name} has {name}={given!r}. Write a number above 0, or math.inf.")
        heights = self.healthy_height
        if not _are_numbers(heights) or len(heights) != 2 or not heights[0] < heights[1]:
            raise UserError(
                f"The robot {self.name} has healthy_height={heights!r}. Write the lowest height and the highest, in m."
            )
        if self.start is not None and (not _are_numbers(self.start) or not all(map(math.isfinite, self.start))):
            raise UserError(f"The robot {self.name} has start={self.start!r}. Write a tuple of finite numbers.")

    @property
    def file(self) -> str:
        """The path of the model's file."""
        return model_files.path_of(self.name, self.xml)

    @property
    def is_built_in(self) -> bool:
        """Whether its file is that of a built-in robot, with which the paper's trials are made."""
        return self.xml in model_files.BUILT_IN


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value)


def _are_numbers(values: Any) -> bool:
    return isinstance(values, tuple) and all(map(_is_number, values))


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


IN_A_MAZE: Final = (SIMPLE_ROB, ANT, HUMANOID)
"""Built-in robots that move in x and y; the others move in the plane of x and z."""


def is_built_in_and_planar(robot: Robot) -> bool:
    """Whether a robot is a built-in one, in all that depends on the model, that moves in the plane of x and z."""
    return fits_as_built_in(robot, in_a_maze=False) and not fits_as_built_in(robot, in_a_maze=True)


def fits_as_built_in(robot: Robot, *, in_a_maze: bool) -> bool:
    """Whether a robot is a built-in one in all that depends on the model; one that can start anywhere in a maze."""
    names = ("xml", "start", "free_coordinates", "seen_velocities", "scales_actions")
    built_in = IN_A_MAZE if in_a_maze else ROBOTS.values()
    return any(all(getattr(robot, name) == getattr(one, name) for name in names) for one in built_in)
