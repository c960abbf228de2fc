"""How fast ecorobot is simulated: ours, a plain use of `mjx.step` on the same model, and plain C MuJoCo, in turns.

`python benchmarks/ecorobot_steps.py` on CPU cores; `--environments 32768` on a GPU. A plain port carries all of MJX's
data from step to step and simulates all boxes; ours carries positions, velocities and accelerations (see
`evoclaims.envs.ecorobot.physics`), and makes a step in one kernel (`evoclaims.kernels.call.kernel`); on a GPU
the same step in XLA's kernels is a case of its own. Counted are environment steps: ours with sensors and rewards, the
others without.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.base import TaskState
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.scene import mjx, on_device
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.trials.devices import MATMUL_PRECISION, configure, usable_cores

Step = Callable[[TaskState, Any], TaskState]
TASKS: dict[str, RobotTask] = {
    "stones": SteppingStones(),
    "obstacles": Obstacles(),
    "stones_ant": SteppingStones(robot=ANT),
    "deceptive": DeceptiveMaze(),
}


def ours(task: RobotTask, make_step: Step, environments: int, steps: int) -> Callable[[], Any]:
    """Return a function that makes `steps` steps in every environment, under random actions held for ten steps."""
    keys = jax.random.split(jax.random.key(0), environments)
    level = jnp.zeros((), jnp.int32)
    state = jax.jit(jax.vmap(task.reset, in_axes=(0, None)))(keys, level)

    def step(carry: tuple[TaskState, Any], index: Any) -> tuple[tuple[TaskState, Any], None]:
        state, total = carry
        action = _actions(index, total.shape[0], task.action_size)
        state = jax.vmap(make_step)(state, action)
        return (state, total + state.reward + jnp.sum(state.observation, axis=1)), None

    def run(state: TaskState) -> Any:
        return jax.lax.scan(step, (state, jnp.zeros(state.reward.shape)), jnp.arange(steps))[0]

    return _timed(run, state)


def plain(task: RobotTask, environments: int, steps: int) -> Callable[[], Any]:
    """Return the same for `mjx.step` alone, on the model with every box: physics without sensors and rewards."""
    model = mjx.put_model(task.scene.whole, impl="jax")
    data = mjx.make_data(task.scene.whole, impl="jax")
    keys = jax.random.split(jax.random.key(0), environments)
    body: Body = jax.vmap(task.reset, in_axes=(0, None))(keys, jnp.zeros((), jnp.int32)).inner.body
    start = jax.vmap(lambda b: data.replace(qpos=b.position, qvel=b.velocity))(body)

    def step(data: Any, index: Any) -> tuple[Any, None]:
        def frame(data: Any, _: None) -> tuple[Any, None]:
            return jax.vmap(lambda d: mjx.step(model, d))(data), None

        data = data.replace(ctrl=_actions(index, data.qpos.shape[0], task.action_size))
        return jax.lax.scan(frame, data, None, length=task.robot.frames)[0], None

    def run(data: Any) -> Any:
        with implicit_promotions():
            return jax.lax.scan(step, data, jnp.arange(steps))[0].qpos

    return _timed(run, on_device(start))


def c_mujoco(task: RobotTask, steps: int) -> float:
    """Return the environment steps per second of plain MuJoCo, a thread a core: physics alone."""
    model, cores = task.scene.whole, usable_cores()
    rng = np.random.default_rng(0)
    start = np.array(task.reset(jax.random.key(0), jnp.zeros((), jnp.int32)).inner.body.position)

    def run(_: int) -> None:
        data = mujoco.MjData(model)
        data.qpos[:] = start
        for index in range(steps):
            if index % 10 == 0:
                data.ctrl[:] = rng.uniform(-1, 1, model.nu)
            mujoco.mj_step(model, data, task.robot.frames)

    began = time.perf_counter()
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(run, range(cores)))
    return cores * steps / (time.perf_counter() - began)


def mujoco_warp(task: RobotTask, environments: int, steps: int) -> Callable[[], Any]:
    """Return the same for MuJoCo Warp on a GPU, on the model with every box: an environment step is a CUDA graph."""
    import mujoco_warp as mjw
    import warp

    warp.config.quiet = True
    model, data = task.scene.whole, mujoco.MjData(task.scene.whole)
    keys = jax.random.split(jax.random.key(0), environments)
    start = np.array(jax.vmap(task.reset, in_axes=(0, None))(keys, jnp.zeros((), jnp.int32)).inner.body.position)
    mujoco.mj_forward(model, data)
    # Room for twice the contacts that ours keeps, of four rows each, and for every joint's limit.
    contacts = 2 * task.robot.contacts
    theirs = mjw.put_model(model)
    worlds = mjw.put_data(model, data, nworld=environments, nconmax=contacts, njmax=4 * contacts + model.njnt)
    warp.copy(worlds.qpos, warp.array(start, dtype=float))
    random = np.random.default_rng(0)
    actions = [warp.array(random.uniform(-1, 1, (environments, model.nu)), dtype=float) for _ in range(-(-steps // 10))]
    theirs.opt.warn_overflow = 0  # one iteration of the solver is what the models ask for
    mjw.step(theirs, worlds)  # compiles
    with warp.ScopedCapture() as capture:
        for _ in range(task.robot.frames):
            mjw.step(theirs, worlds)

    def again() -> float:
        warp.synchronize()
        began = time.perf_counter()
        for index in range(steps):
            if index % 10 == 0:
                warp.copy(worlds.ctrl, actions[index // 10])
            warp.capture_launch(capture.graph)
        warp.synchronize()
        return time.perf_counter() - began

    again()
    return again


def report_difference(task: RobotTask) -> None:
    """Print how far the kernel's observations are from those of XLA's kernels, each a step from the same state."""
    step, plain_step = (jax.jit(jax.vmap(f)) for f in (task.step, task.plain_step))
    state = jax.vmap(task.reset, (0, None))(jax.random.split(jax.random.key(0), 1024), jnp.zeros((), jnp.int32))
    differences = []
    for index in range(50):
        action = _actions(jnp.asarray(index), 1024, task.action_size)
        one, other = step(state, action), plain_step(state, action)
        differences.append(np.abs(np.asarray(one.observation - other.observation)).max(axis=1))
        state = other
    median, most, largest = np.quantile(differences, (0.5, 0.99, 1.0))
    print(
        f"    one kernel and XLA's differ by {median:.1e} (median), {most:.1e} (99%), {largest:.1e} (largest)",
        flush=True,
    )


def _actions(index: Any, environments: int, size: int) -> Any:
    """Draw actions in [-1, 1], the same ones for ten steps."""
    return jax.random.uniform(jax.random.key(index // 10), (environments, size), minval=-1.0, maxval=1.0)


def _timed(run: Callable[[Any], Any], start: Any) -> Callable[[], float]:
    """Compile, run once, and return a function that runs and takes the time, s."""
    cores = usable_cores() if jax.devices()[0].platform == "cpu" else 1
    shares = [jax.tree.map(lambda leaf, i=i: jnp.array_split(leaf, cores)[i], start) for i in range(cores)]
    began = time.perf_counter()
    compiled = jax.jit(run).lower(shares[0]).compile()
    print(f"    compiled in {time.perf_counter() - began:.1f} s", flush=True)
    pool = ThreadPoolExecutor(cores)

    def all_shares() -> None:
        list(pool.map(lambda share: jax.block_until_ready(compiled(share)), shares))

    all_shares()

    def again() -> float:
        began = time.perf_counter()
        all_shares()
        return time.perf_counter() - began

    return again


def main() -> None:
    """Compare in turns and print medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", default=list(TASKS), help=f"of {', '.join(TASKS)}")
    parser.add_argument("--environments", type=int, nargs="*", default=[1024])
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--no-plain", action="store_true")
    parser.add_argument("--warp", action="store_true", help="compare with MuJoCo Warp, where it is installed, too")
    options = parser.parse_args()
    configure()
    warnings.simplefilter("ignore")
    on_cpu = jax.devices()[0].platform == "cpu"
    print(f"jax {jax.__version__}, {jax.devices()[0].device_kind}, {os.uname().machine}", flush=True)
    with jax.default_matmul_precision(MATMUL_PRECISION):
        for name in options.tasks:
            task = replace(TASKS[name], episode_steps=10**6)
            for environments in options.environments:
                print(f"{name}, {environments} environments", flush=True)
                runs = {"ours": ours(task, task.step, environments, options.steps)}
                if not on_cpu and not options.no_plain:
                    report_difference(task)
                    runs["ours, in XLA's kernels"] = ours(task, task.plain_step, environments, options.steps)
                if not options.no_plain:
                    runs["plain mjx.step"] = plain(task, environments, options.steps)
                if options.warp:
                    runs["MuJoCo Warp"] = mujoco_warp(task, environments, options.steps)
                rates: dict[str, list[float]] = {}
                for _ in range(options.rounds):
                    for kind, run in runs.items():
                        rates.setdefault(kind, []).append(environments * options.steps / run())
                    if on_cpu:
                        rates.setdefault("C MuJoCo", []).append(c_mujoco(task, 2000))
                for kind, values in rates.items():
                    print(f"    {kind}: {statistics.median(values):,.0f} steps/s", flush=True)


if __name__ == "__main__":
    main()
