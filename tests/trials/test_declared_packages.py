"""No method or task declares fewer packages than compute it, by its imports and by the programs that it traces."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, distribution
from typing import Any, Final

import grimp
import jax
import numpy as np
import pytest
import qdax.core.map_elites  # noqa: F401  (MAP-Elites imports it while it is traced; what runs then makes no program)
from jax.extend import core as jaxprs

from evoclaims.core.packages import ALWAYS, UNDECLARED, packages_of
from evoclaims.envs.ecorobot import robot_task
from evoclaims.kernels.emit import machine_code
from evoclaims.methods.map_elites import MapElites
from evoclaims.networks.mlp import Mlp
from evoclaims.trials.devices import MATMUL_PRECISION
from evoclaims.trials.program import Program
from evoclaims.trials.spec import Condition
from reproductions.nisioti2025 import REPRODUCTION

pytestmark = pytest.mark.newest

SMOKE: Final = REPRODUCTION.tiers["smoke"].conditions
ELSEWHERE: Final = frozenset({"evoclaims", *ALWAYS})
"""What every trial depends on, or what revisions tell of."""

IMPORTED_AS: Final = {"mujoco": {"mujoco", "mujoco-mjx"}}
"""Packages behind a name that is imported, where they are not of that name."""

STRUCTURES: Final = ("flax/struct.py",)
"""Files that hold what a library computes with and compute nothing themselves."""

COMPONENTS: Final = {
    (type(part), packages_of(part)): part
    for condition in (*SMOKE.values(), *REPRODUCTION.variants["rows_so_far"].conditions["smoke"].values())
    for part in (condition.method, condition.task)
}


@pytest.fixture(scope="module")
def graph() -> Any:
    """Who imports whom."""
    return grimp.build_graph("evoclaims", "reproductions", include_external_packages=True, cache_dir=None)


@pytest.mark.parametrize("component", COMPONENTS.values(), ids=lambda part: part.name)
def test_a_declaration_covers_all_that_a_methods_or_tasks_module_imports(component: Any, graph: Any) -> None:
    module = type(component).__module__
    # A reproduction imports public names through their package, past which a graph of imports does not see.
    homes = {getattr(value, "__module__", "") for value in vars(sys.modules[module]).values()}
    used = {module, *(home for home in homes if home in graph.modules)}
    reached = used.union(*map(graph.find_upstream_modules, used))
    imported = {name for name in reached if not name.startswith("evoclaims")}
    found = set().union(*(IMPORTED_AS.get(name, {name}) for name in imported)) & {*UNDECLARED}
    assert found <= {*packages_of(component)}


def _owners() -> dict[str, str]:
    """Return the package that each installed file of a recorded package belongs to."""
    found = {}
    for package in UNDECLARED:
        try:
            files = distribution(package).files or ()
        except PackageNotFoundError:
            continue
        found.update({os.path.realpath(str(file.locate())): package for file in files if file.suffix == ".py"})
    return found


def _equations(program: Any) -> Iterator[Any]:
    """Give the equations of a traced program, those within others included."""
    for equation in program.eqns:
        yield equation
        for value in equation.params.values():
            for inner in value if isinstance(value, tuple | list) else (value,):
                if isinstance(inner, jaxprs.ClosedJaxpr | jaxprs.Jaxpr):
                    yield from _equations(getattr(inner, "jaxpr", inner))


def _computing(condition: Condition) -> tuple[set[str], set[str]]:
    """Trace a condition's programs; return the files whose lines made equations, and those whose functions ran."""
    ran, programs, shapes = set(), [], None
    warm = Program(condition)  # libraries are imported when they are used, and an import calls functions of others
    jax.eval_shape(warm.advance, jax.eval_shape(warm.start, np.int32(0), np.bool_(False)), np.int32(1))
    jax.clear_caches()  # a function traced before keeps the lines that called it then
    robot_task._start_kernel.cache_clear()
    robot_task._step_kernel.cache_clear()
    # What the processor has is asked once a process, for whichever method is first; its kernels ask again.
    machine_code.lanes()
    if "llvmlite" in condition.packages:
        machine_code.lanes.cache_clear()

    def note(frame: Any, event: str, argument: Any) -> None:
        if event == "call":
            ran.add(frame.f_code.co_filename)

    program = Program(condition)
    before = sys.getprofile()
    sys.setprofile(note)
    try:
        with jax.default_matmul_precision(MATMUL_PRECISION):
            first, shapes = jax.make_jaxpr(program.start, return_shape=True)(np.int32(0), np.bool_(False))
            programs = [
                first,
                jax.make_jaxpr(program.advance)(shapes, np.int32(1)),
                jax.make_jaxpr(program.examine)(shapes),
            ]
    finally:
        sys.setprofile(before)
    tracebacks = [one.source_info.traceback for traced in programs for one in _equations(traced.jaxpr)]
    made = {frame.file_name for traceback in tracebacks if traceback is not None for frame in traceback.frames}
    return made, ran


_MAZE: Final = SMOKE["map_elites", "deceptive_maze_difficult"]
TRACED: Final = {
    "cma_es on n_parity": SMOKE["cma_es", "n_parity"],
    "ppo on n_parity": SMOKE["ppo", "n_parity"],
    "map_elites on deceptive_maze": replace(_MAZE, method=MapElites(network=Mlp((4,)), batch=2, initial=2)),
}
"""One condition for each library; a method that imports none needs no trace."""


@pytest.mark.parametrize("condition", TRACED.values(), ids=TRACED)
def test_a_declaration_covers_every_package_whose_functions_make_a_conditions_programs(condition: Condition) -> None:
    owners = _owners()
    made, ran = _computing(condition)
    ran = {file for file in ran if not file.endswith(STRUCTURES)}
    found = {owners[path] for path in map(os.path.realpath, made | ran) if path in owners}
    assert found <= {*condition.packages}
    expected = {*condition.packages} - ELSEWHERE - {"mujoco"}  # of MuJoCo's own, which is compiled, no line is seen
    assert found == expected, "a declaration is no larger than it has to be, or this test sees too little"
