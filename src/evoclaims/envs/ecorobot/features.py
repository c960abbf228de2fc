"""What a step simulates of a model: everything else in a custom robot's file is refused, naming it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import mujoco
import numpy as np

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot import model_files

_ARRAYS: Final = {
    "actuator_": (
        "acc0 actadr actnum biasprm biastype ctrladr ctrllimited ctrlnum ctrlrange ctrlspec dynprm "
        "forcelimited forcerange gainprm gaintype gear length0 lengthrange outadr outnum trnid trntype user"
    ),
    "body_": (
        "conaffinity contype dofadr dofnum geomadr geomnum gravcomp inertia invweight0 ipos iquat jntadr "
        "jntnum margin mass parentid pos quat rootid sameframe simple subtreemass treeid user weldid"
    ),
    "dof_": "M0 Madr armature bodyid damping invweight0 jntid length parentid simplenum solimp solref treeid",
    "geom_": (
        "aabb bodyid conaffinity condim contype dataid friction gap margin pos priority quat rbound sameframe "
        "size solimp solmix solref type user"
    ),
    "jnt_": (
        "actfrclimited actfrcrange actgravcomp actuatorid axis bodyid dofadr limited margin pos qposadr range "
        "solimp solref stiffness type user"
    ),
    "exclude_": "signature",
    "key_": "act ctrl mpos mquat qpos qvel time",
    "mesh_": (
        "face faceadr facenormal facenum graph graphadr normal normaladr normalnum polyadr polymap polymapadr "
        "polymapnum polynormal polynum polyvert polyvertadr polyvertnum pos quat scale vert vertadr vertnum "
        "extrema"
    ),
    "pair_": "dim friction gap geom1 geom2 margin signature solimp solref solreffriction",
    "qpos": "0 _spring",
    # Sensors are not read, and sites are only for them and for motors.
    "sensor_": "adr cutoff datatype dim intprm needstage noise objid objtype refid reftype type user",
    "site_": "bodyid dataid pos quat sameframe size type user",
    "tree_": "bodyadr bodynum dofadr dofnum sleep_policy",
    "tuple_": "adr objid objprm objtype size",
    "efm": "0_L 0_L_colind 0_L_rowadr 0_L_rownnz 0_dofid C_perm",
}
"""MuJoCo's arrays that a step uses, or that change nothing in it, by how they begin."""
SIMULATED: Final = frozenset(begin + end for begin, ends in _ARRAYS.items() for end in ends.split())

NAMES: Final = {
    "eq_": "equality constraints",
    "tendon_": "tendons",
    "ten_": "tendons",
    "wrap_": "tendons",
    "flex": "deformable bodies",
    "hfield_": "height fields",
    "plugin": "plugins",
    "dof_frictionloss": "friction loss in joints",
    "dof_dampingpoly": "damping that is not linear",
    "jnt_stiffnesspoly": "springs that are not linear",
    "geom_fluid": "ellipsoids in a fluid (fluidshape)",
    "geom_adhesion": "adhesion",
    "geom_surfacevel": "moving surfaces",
    "actuator_dyntype": "actuators with a state",
    "actuator_delay": "actuators with a delay",
    "actuator_history": "actuators with a delay",
    "actuator_armature": "actuators with an armature",
    "actuator_damping": "actuators with damping",
    "actuator_dampingpoly": "actuators with damping",
    "actuator_cranklength": "slider-cranks",
}
"""What arrays mean that a step does not use, by how they begin; others are named as they are."""

COUNTS: Final = {
    "na": "actuators with a state",
    "neq": "equality constraints",
    "ntendon": "tendons",
    "nflex": "deformable bodies",
    "nhfield": "height fields",
    "nmocap": "motion-capture bodies",
    "nplugin": "plugins",
}
"""What a model has none of, by MuJoCo's counts."""

_OPTIONS: Final = (
    "timestep gravity wind density viscosity magnetic impratio iterations ls_iterations tolerance ls_tolerance "
    "jacobian noslip_tolerance ccd_iterations ccd_tolerance sdf_initpoints sdf_iterations sleep_tolerance "
    "disableflags enableflags o_margin o_solref o_solimp o_friction"
)
OPTIONS: Final = frozenset(_OPTIONS.split())
"""MuJoCo's options that may have any value: a step uses them, or they change nothing in it; flags are below."""
FLAGS: Final = {
    "disable": (
        "CONSTRAINT LIMIT CONTACT GRAVITY CLAMPCTRL WARMSTART FILTERPARENT ACTUATION REFSAFE SENSOR MIDPHASE EULERDAMP "
        "AUTORESET NATIVECCD ISLAND MULTICCD FRICTIONLOSS EQUALITY"
    ),
    "enable": "ENERGY FWDINV INVDISCRETE",
}
"""Flags that may be set."""
LARGEST_TOLERANCE: Final = 1e-8
"""MuJoCo's own: with larger ones C stops before the minimum, which a step here reaches."""
RANGES: Final = ("actuator_ctrlrange", "actuator_forcerange", "jnt_range", "jnt_actfrcrange")
"""MuJoCo's arrays of limits, of two columns."""
TRANSMISSIONS: Final = ("JOINT", "JOINTINPARENT", "SITE")


def require_simulated(name: str, model: mujoco.MjModel) -> None:
    """Check that a step simulates all that a custom robot's model has.

    Raises:
        UserError: naming the robot and what is beyond a step.
    """
    if beyond := sorted(set(_beyond(model))):
        raise UserError(
            f"The model of the robot {name} has {', '.join(beyond)}, which is not simulated here. Remove it from the "
            "file. A step simulates joints with limits, springs and damping, motors without a state, and contacts "
            "with pyramidal friction cones, by MuJoCo's Euler or RK4 integrator."
        )
    if model.nbody < 2 or not model.body_jntnum[1]:
        body = model.body(1).name or "without a name" if model.nbody > 1 else ""
        has = f"its first body ({body}) has no joint" if body else "it has no body"
        raise UserError(
            f"The model of the robot {name} has no torso: {has}. Begin <worldbody> with a body that has joints: it "
            "is the torso, and its joints move the robot through the world."
        )
    for array in sorted(SIMULATED):
        numbers = getattr(model, array, np.zeros(0))
        if numbers.dtype.kind == "f" and not np.isfinite(numbers).all():
            raise UserError(
                f"The model of the robot {name} has numbers in {array} that are not finite. Write finite ones."
            )
    for option in sorted(OPTIONS):
        if not np.isfinite(getattr(model.opt, option)).all():
            raise UserError(
                f"The model of the robot {name} has {option}={getattr(model.opt, option)}, which is not finite. "
                "Write finite numbers."
            )
    if model.opt.timestep <= 0:
        raise UserError(
            f"The model of the robot {name} has timestep={model.opt.timestep:g}, so its time would not go on. Write "
            "a number above 0, in s."
        )
    for array in RANGES:
        low, high = getattr(model, array).T
        for row in np.flatnonzero(low > high):
            raise UserError(
                f"The model of the robot {name} has a reversed range in {array} ({low[row]:g} {high[row]:g}), which "
                "MuJoCo reads as no limit. Write the lower number first."
            )


def _beyond(model: mujoco.MjModel) -> Iterator[str]:
    """Yield what a model has that a step does not simulate."""
    for name in dir(model):
        array = getattr(model, name)
        if not isinstance(array, np.ndarray) or name in SIMULATED or model_files.is_cosmetic(name):
            continue
        if np.any((array != 0) & (array != -1)):
            yield next((feature for begin, feature in NAMES.items() if name.startswith(begin)), f"{name} (of MuJoCo's)")
    for count, feature in COUNTS.items():
        if getattr(model, count, 0) > 0:
            yield feature
    bits = {"disable": mujoco.mjtDisableBit, "enable": mujoco.mjtEnableBit}
    for kind, kinds in bits.items():
        begin = "mjDSBL_" if kind == "disable" else "mjENBL_"
        allowed = sum(int(getattr(kinds, begin + flag, 0)) for flag in FLAGS[kind].split())
        set_ = int(getattr(model.opt, f"{kind}flags"))
        for flag in kinds.__members__.values():
            if int(flag) & set_ & ~allowed and not flag.name.startswith("mjN"):
                yield f"the flag {flag.name.partition('_')[2].lower()}={kind}"
    usual = mujoco.MjOption()
    for option in dir(usual):
        given = getattr(model.opt, option)
        if option.startswith("_") or callable(given) or option in OPTIONS:
            continue
        if option == "integrator" and given == mujoco.mjtIntegrator.mjINT_RK4:
            continue
        if np.any(given != getattr(usual, option)):
            yield _option(option, given)
    if model.opt.tolerance > LARGEST_TOLERANCE:
        yield f"a solver that stops early (tolerance={model.opt.tolerance:g}, {LARGEST_TOLERANCE:g} at most)"
    transmissions = {int(getattr(mujoco.mjtTrn, f"mjTRN_{kind}")) for kind in TRANSMISSIONS}
    if not set(model.actuator_trntype.tolist()) <= transmissions:
        yield "actuators that drive no joint"


def _option(name: str, given: Any) -> str:
    """Return what a model with an unusual option has."""
    known = {
        "cone": "elliptic friction cones",
        "integrator": "another integrator than Euler or RK4",
        "solver": "another solver than Newton's",
        "disableactuator": "disabled groups of actuators",
    }
    return known.get(name, f"{name}={given}")
