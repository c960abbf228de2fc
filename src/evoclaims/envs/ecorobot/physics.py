"""Simulating a scene with MJX's functions, carrying between steps only what a step cannot recompute."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.foreign import implicit_promotions
from evoclaims.core.pytree import pytree
from evoclaims.envs.ecorobot.constraints import cholesky_solve, constrained_acceleration
from evoclaims.envs.ecorobot.contacts import constraints
from evoclaims.envs.ecorobot.pose import torso
from evoclaims.envs.ecorobot.scene import GEOMS, Places, Scene, box_geoms, mjx, on_device

LARGEST: Final = 1e10
"""MuJoCo's limit for valid numbers (mjMAXVAL)."""


@pytree
class Body:
    """The moving state.

    Attributes:
        position: generalized positions, MuJoCo's qpos; lengths in m, angles in rad, orientations as quaternions.
        velocity: MuJoCo's qvel, per s.
        acceleration: of the last step, per s², where the next step's solver starts.
    """

    position: Float[Array, " nq"]
    velocity: Float[Array, " nv"]
    acceleration: Float[Array, " nv"]


def resting(position: Float[Array, " nq"], velocity: Float[Array, " nv"]) -> Body:
    """Return a body at the start of an episode."""
    return Body(position=position, velocity=velocity, acceleration=jnp.zeros_like(velocity))


def act(scene: Scene, body: Body, control: Float[Array, " nu"], places: Places) -> Body:
    """Hold the motors at `control` for one environment step; `places` as in `Scene.turns`."""

    def frame(body: Body, _: None) -> tuple[Body, None]:
        return _frame(scene, body, control, places), None

    return jax.lax.scan(frame, body, None, length=scene.robot.frames)[0]


def is_stable(body: Body) -> Bool[Array, ""]:
    """Whether the simulation has not diverged, by MuJoCo's own test of positions, velocities and accelerations.

    With large steps, a fast ant can gain speed without limit. C MuJoCo then warns and resets the robot; MJX goes on
    to NaN.
    """
    numbers = jnp.concatenate([body.position, body.velocity, body.acceleration])
    return jnp.all(jnp.abs(numbers) <= LARGEST)  # NaN: False


# MJX takes a second to trace; with its own jit this is traced once per scene, not once per use.
@partial(jax.jit, static_argnums=0)
def _frame(scene: Scene, body: Body, control: Float[Array, " nu"], places: Places) -> Body:
    """Simulate one time step, as `mjx.step` does with semi-implicit Euler integration, or as C does with RK4."""
    with implicit_promotions():
        model = on_device(scene.mjx)
        if places:
            geoms = box_geoms(scene.model)
            theirs = {name: jnp.asarray(array) for name, array in places.items()}
            if scene.near < len(scene.boxes):
                nearest = _nearest(scene, model, body, places)
                theirs = {name: array[nearest] for name, array in theirs.items()}
            if "geom_quat" in theirs:  # boxes turn only about the vertical, which saves many operations if known
                theirs["geom_quat"] *= jnp.array([1.0, 0.0, 0.0, 1.0])
            model = model.replace(**{name: getattr(model, name).at[geoms].set(new) for name, new in theirs.items()})
        data = on_device(scene.blank).replace(ctrl=control)
        if scene.integrates_by_rk4:
            return _runge_kutta(scene, model, data, body)
        acceleration, mass, data = _accelerated(scene, model, data, body)
        used = acceleration
        if scene.damps_implicitly:  # (M + h B) a' = M a: MuJoCo's documentation, "Computation", numerical integration
            damping = model.opt.timestep * model.dof_damping
            used = acceleration - cholesky_solve(mass + jnp.diag(damping), damping * acceleration)
        data = mjx.euler(model, data.replace(qacc=used))
    return Body(position=data.qpos, velocity=data.qvel, acceleration=acceleration)


def _accelerated(scene: Scene, model: Any, data: Any, body: Body) -> tuple[Array, Array, Any]:
    """Return a body's acceleration, the mass matrix, and MJX's data there; `body.acceleration` is a guess."""
    data = data.replace(qpos=body.position, qvel=body.velocity)
    data = mjx.kinematics(model, data)
    data = mjx.com_pos(model, data)
    data = mjx.crb(model, data)
    rows = constraints(scene.robot, model, data)
    data = mjx.transmission(model, data)
    data = mjx.fwd_velocity(model, data)
    data = mjx.fwd_actuation(model, data)
    mass = mjx.full_m(model, data)
    force = data.qfrc_passive - data.qfrc_bias + data.qfrc_actuator
    return constrained_acceleration(mass, force, body.acceleration, rows, scene.newton_steps), mass, data


def _runge_kutta(scene: Scene, model: Any, data: Any, body: Body) -> Body:
    """Simulate one time step by the classical Runge-Kutta method: MuJoCo's documentation, "Computation"."""

    def moved(velocity: Array) -> Array:
        # Without acceleration, Euler's step adds the velocity to the positions, and turns quaternions by it.
        still = jnp.zeros_like(velocity)
        position: Array = mjx.euler(model, data.replace(qpos=body.position, qvel=velocity, qacc=still)).qpos
        return position

    def stage(carry: Any, _: None) -> Any:
        number, velocity, acceleration, mean_velocity, mean_acceleration = carry
        # One loop for all four, the first of them at the start itself, so that MJX is traced once.
        ahead = jnp.where(number == 0, 0.0, jnp.where(number == 3, 1.0, 0.5)).astype(velocity.dtype)
        weight = jnp.where((number == 0) | (number == 3), 1.0 / 6.0, 1.0 / 3.0).astype(velocity.dtype)
        position = moved(ahead * velocity)
        velocity = body.velocity + model.opt.timestep * ahead * acceleration
        acceleration = _accelerated(scene, model, data, Body(position, velocity, acceleration))[0]
        mean_velocity, mean_acceleration = mean_velocity + weight * velocity, mean_acceleration + weight * acceleration
        return (number + 1, velocity, acceleration, mean_velocity, mean_acceleration), None

    none = jnp.zeros_like(body.velocity)
    start = (jnp.int32(0), body.velocity, body.acceleration, none, none)
    _, _, last, velocity, acceleration = jax.lax.scan(stage, start, None, length=4)[0]
    return Body(moved(velocity), body.velocity + model.opt.timestep * acceleration, last)


def _nearest(scene: Scene, model: Any, body: Body, places: Places) -> Int[Array, " near"]:
    """Return which boxes are nearest to the torso's centre, seen from above."""
    alike = {name: getattr(model, name)[box_geoms(scene.model)[:1]] for name in GEOMS if name not in places}
    centre, size, quaternion = (jnp.asarray({**alike, **places}[name]) for name in GEOMS)
    w, z = quaternion[:, 0], quaternion[:, 3]  # boxes turn only about the vertical
    cosine, sine = 1.0 - 2.0 * z * z, 2.0 * w * z
    x, y = (torso(scene, body.position).place[:2][None] - centre[:, :2]).T
    local = jnp.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)
    outside = jnp.maximum(jnp.abs(local) - size[:, :2], 0.0)
    return jax.lax.top_k(-jnp.sum(outside**2, axis=1), scene.near)[1]
