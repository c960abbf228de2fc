"""The models in robots' files: reading them, and a hash of what a robot is made of."""

from __future__ import annotations

import hashlib
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file

OURS: Final = "evoclaims.envs.ecorobot:assets/"
BRAX: Final = "brax:envs/assets/"

BUILT_IN: Final = {
    OURS + "simple_rob.xml": "cc69a0fa71a5eac98f21ed6081938519bc24c31e89c94176cc0ee32e4a229648",
    BRAX + "ant.xml": "2edb5f3fb33541e852fed27db08af6d2e05baa47144caee75f7d368bb9d5a15b",
    BRAX + "half_cheetah.xml": "4f4a2c6568442331d7ea9478da3c5b7a8664772f756339b384d3e74c0eeee344",
    BRAX + "hopper.xml": "0fe1b2b922b677f60603da4fc8b9165f4ad98f61ce7f836e13e9a53bc690922d",
    BRAX + "humanoid.xml": "b687fba9d89a5b4b124fb4674641fb48a06401dbfa5423ddc065a253473e370d",
    BRAX + "walker2d.xml": "794c119d4a41ca1307b8a2e81be5663241713d9a53c0812bf93cd52df02ac07f",
}
"""The built-in robots' files, by SHA-256.

They are simulated as the paper's code does (one solver iteration, explicit damping), whatever their options; no other
file is. Their trials' ids do not hold what they are made of, since these files do not change.
"""

COSMETIC: Final = (
    *("bvh_", "cam_", "light_", "mat_", "name_", "names", "numeric_", "oct_", "paths", "skin_", "tex_", "text_"),
    *("mesh_texcoord", "mesh_bvh", "mesh_oct", "flex_texcoord", "flex_bvh", "B_", "D_", "M_", "map"),
)
"""How MuJoCo's arrays begin that only pictures show, or that only say where others are stored."""
COSMETIC_ENDS: Final = ("_rgba", "_matid", "_group", "pathadr", "_bvhadr", "_bvhnum")
"""How such arrays end."""
NAMED: Final = ("BODY", "JOINT", "GEOM", "SITE", "ACTUATOR", "SENSOR", "TENDON", "KEY")
"""Kinds of objects whose names count, since a task's rule may look them up."""
DIGITS: Final = 30
"""Binary digits of a number that count: more than float32 has, and fewer than differ between machines."""


def path_of(name: str, xml: str) -> str:
    """Return the path of a robot's file, "package:path".

    Raises:
        UserError: when there is no such package, or no such file in it.
    """
    package, _, path = xml.partition(":")
    try:
        spec = find_spec(package)  # the package itself need not be imported: Brax takes seconds
    except (ImportError, ValueError):
        spec = None
    folders = [Path(folder) for folder in (spec and spec.submodule_search_locations) or ()]
    if not folders:
        raise UserError(
            f"The robot {name!r} has its model in {xml!r}, and there is no package {package!r}. Write PACKAGE:PATH, "
            "with a package that can be imported."
        )
    found = next((folder / path for folder in folders if (folder / path).is_file()), folders[0] / path)
    if not found.is_file():
        raise UserError(
            f"The robot {name!r} has its model in {xml!r}, and there is no file {found}. Correct the path after the "
            "colon."
        )
    return str(found)


def read(name: str, xml: str) -> mujoco.MjSpec:
    """Return the specification in a robot's file.

    Raises:
        UserError: when it cannot be read, or when a built-in robot's file is not the known one.
    """
    path = path_of(name, xml)
    if xml in BUILT_IN and hashlib.sha256(read_file(Path(path))).hexdigest() != BUILT_IN[xml]:
        raise UserError(
            f"The model of the robot {name}, {path}, is not the file with which the paper's trials were made. "
            "Install its package again. To use the changed file, copy it into a package of your own."
        )
    try:
        return mujoco.MjSpec.from_file(path)
    except (ValueError, OSError, mujoco.FatalError) as error:
        raise UserError(
            f"The model of the robot {name} cannot be read: {in_one_line(error)}. Correct {path}."
        ) from error


def compiled(name: str, spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Return the compiled model of a robot's specification.

    Raises:
        UserError: when it cannot be compiled, such as for a mesh without a file.
    """
    # As MuJoCo (3.17) advises instead of the deprecated attribute `settotalmass`, which the half-cheetah has.
    total, spec.compiler.settotalmass = spec.compiler.settotalmass, -1.0
    try:
        model = spec.compile()
    except (ValueError, OSError, mujoco.FatalError, UserWarning) as error:  # a warning where filters make it an error
        raise UserError(
            f"The model of the robot {name} cannot be compiled: {in_one_line(error)}. Correct its file."
        ) from error
    if total > 0:
        mujoco.mj_setTotalmass(model, total)
        mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def own_model(name: str, xml: str) -> mujoco.MjModel:
    """Return the model as a robot's file says."""
    return compiled(name, read(name, xml))


def body_hash(model: mujoco.MjModel) -> str:
    """Return a hash of what a robot is made of: SHA-256 of its compiled model's arrays, options and names.

    It does not depend on comments, colours, cameras or where files are, and numbers count to nine decimal digits.
    Arrays of zeros are left out, so that a release of MuJoCo may add some. Another processor may compile a model to
    other numbers where these are ambiguous, such as the principal axes of a symmetric mesh; its hash is then another.
    """
    arrays = {name: getattr(model, name) for name in sorted(dir(model)) if not is_cosmetic(name)}
    parts: dict[str, Any] = {
        name: [list(array.shape), hashlib.sha256(_rounded(array)).hexdigest()]
        for name, array in arrays.items()
        if isinstance(array, np.ndarray) and array.any()
    }
    for name in ("nq", "nv", "nu", "nbody", "njnt", "ngeom"):
        parts[name] = int(getattr(model, name))
    parts["options"] = {name: np.asarray(value).tolist() for name, value in options(model).items()}
    for kind in NAMED:
        number = getattr(mujoco.mjtObj, f"mjOBJ_{kind}")
        count = {"BODY": model.nbody, "JOINT": model.njnt, "ACTUATOR": model.nu}.get(kind) or getattr(
            model, f"n{kind.lower()}"
        )
        parts[kind] = [mujoco.mj_id2name(model, number, i) or "" for i in range(count)]
    return content_hash(parts)


def require_unedited(name: str, xml: str, body: str | None) -> None:
    """Check that a robot's file, and all that it includes, is as it was when the robot was made.

    Raises:
        UserError: when it was edited meanwhile: trials would be stored as those of the old body.
    """
    if body_hash(own_model(name, xml)) != body:
        raise UserError(f"The model of the robot {name} was edited while this process ran. Start the process again.")


def is_cosmetic(name: str) -> bool:
    """Whether one of MuJoCo's arrays has no part in physics: for pictures, or bookkeeping."""
    return name.startswith(("_", *COSMETIC)) or name.endswith(COSMETIC_ENDS)


def options(model: mujoco.MjModel) -> dict[str, Any]:
    """Return a model's options that are not 0, by name."""
    values = {name: getattr(model.opt, name) for name in dir(model.opt) if not name.startswith("_")}
    return {name: value for name, value in values.items() if not callable(value) and np.any(value)}


def _rounded(array: NDArray[Any]) -> bytes:
    """Return an array's bytes, the same on every machine that computes the same but for rounding."""
    if array.dtype.kind != "f":
        return array.astype("<i8").tobytes()
    numbers = array.astype(np.float64)
    numbers[np.abs(numbers) < 1e-12 * np.max(np.abs(numbers))] = 0.0  # what is left of sums that cancel
    fraction, exponent = np.frexp(numbers)
    rounded: NDArray[np.float64] = np.ldexp(np.rint(np.ldexp(fraction, DIGITS)), exponent - DIGITS)
    return (rounded + 0.0).astype("<f8").tobytes()  # adding 0.0 makes -0.0 zero


def in_one_line(error: Exception) -> str:
    """Return an error's message, of which MuJoCo writes several lines."""
    return " ".join(str(error).split())
