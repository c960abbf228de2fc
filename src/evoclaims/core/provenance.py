"""Where a number came from: code revision, versions, device, machine and the flags that change results."""

from __future__ import annotations

import copy
import functools
import importlib.metadata
import os
import platform
import re
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

PACKAGES: Final = (
    "evoclaims",
    "jax",
    "jaxlib",
    "numpy",
    "flax",
    "optax",
    "brax",
    "evosax",
    "qdax",
    "mujoco",
    "mujoco-mjx",
    "llvmlite",
    "scipy",
    "statsmodels",
    "pandas",
)
CUDA: Final = re.compile(r"jax-cuda\d+-(plugin|pjrt)|nvidia-.+")
"""Names of packages that contain CUDA and its libraries; a machine without a GPU has none of them."""

FIXES_BITS: Final = ("machine", "versions", "xla_flags", "matmul_precision", "x64", "prng")
"""Parts of a provenance that can change a result's bits, besides the device."""

VECTORS: Final = ("avx512f", "avx2", "avx", "neon", "sse2")
"""Instruction sets for vectors as LLVM calls them, the widest first."""

CHANGES_NOTHING: Final = ("--xla_dump_", "--xla_force_host_platform_device_count", "--xla_gpu_cuda_data_dir")
"""How flags of XLA begin that leave all computations as they are."""

GIT_SECONDS: Final = 5.0
"""Time limit for git; on a slow network folder, a missing revision is better than a stalled run."""


def collect() -> dict[str, Any]:
    """Return the provenance of this process as plain JSON, looked up once and copied for each caller.

    Returns:
        "git" ({"sha", "dirty"} of the repository around the current folder, or None), "versions" (by package
        name, None where absent, and "python"), "cuda" (versions of the CUDA packages by name; empty if none),
        "device" ({"platform", "kind", "count"}), "machine" (a string such as "Linux x86_64 AMD EPYC 7B13"),
        "instructions" (see `instructions`), "xla_flags" (string or None), "matmul_precision" (string or None),
        "x64" (bool) and "prng" ({"implementation", "partitionable"}: jax's generator of random bits).
    """
    return copy.deepcopy(_collected())


@functools.cache
def _collected() -> dict[str, Any]:
    """Look everything up; cached because git and the device do not change while a process runs."""
    import jax  # here, so that reading records and `--help` stay fast

    config: Any = jax.config  # the type stubs do not list its options
    precision = config.jax_default_matmul_precision
    return {
        "git": git_state(),
        "versions": versions(),
        "cuda": cuda_versions(),
        "device": device_of(jax.devices()),
        "machine": machine_class(),
        "instructions": instructions(),
        "xla_flags": os.environ.get("XLA_FLAGS"),
        "matmul_precision": None if precision is None else str(precision),
        "x64": bool(config.jax_enable_x64),
        "prng": {
            "implementation": str(config.jax_default_prng_impl),
            "partitionable": bool(config.jax_threefry_partitionable),
        },
    }


@functools.cache
def changing_flags() -> str | None:
    """Return the flags of XLA by which this process compiles otherwise than by default; see `flags_that_change`.

    Read once, as XLA does.
    """
    return flags_that_change(os.environ.get("XLA_FLAGS"))


def flags_that_change(flags: object) -> str | None:
    """Return those flags of XLA that may change a trial, in order, of each name the last; None without any."""
    if not isinstance(flags, str):
        return None
    last = {flag.partition("=")[0]: flag for flag in flags.split() if not flag.startswith(CHANGES_NOTHING)}
    return " ".join(last[name] for name in sorted(last)) or None


def what_fixes_bits(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of a provenance that determine a computation's bits, if present.

    Two runs of the same program with these parts equal should be bit-identical. CUDA's versions count only on a
    GPU, and the processor's instructions only on a CPU.
    """
    device = provenance.get("device") or {}
    names = (*FIXES_BITS, "cuda" if device.get("platform") == "gpu" else "instructions")
    found = {"kind": device.get("kind"), **{name: provenance[name] for name in names if name in provenance}}
    return {name: flags_that_change(value) if name == "xla_flags" else value for name, value in found.items()}


def differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> set[str]:
    """Return which parts that fix bits differ between two provenances; what one lacks, as old ones do, is left out."""
    ours, theirs = what_fixes_bits(one), what_fixes_bits(other)
    return {name for name in ours.keys() & theirs.keys() if ours[name] != theirs[name]}


def same_bits(one: Mapping[str, Any], other: Mapping[str, Any], but: str = "") -> bool:
    """Whether one trial should have the same bits by two provenances, but for what the part `but` changes.

    Only CPUs of one class of machine promise it. A provenance without device, machine or versions says too little, and
    so does one without the processor's instructions, as old ones are, beside one that has them.
    """
    known = all(made.get(part) for made in (one, other) for part in ("device", "machine", "versions"))
    known &= ("instructions" in one) == ("instructions" in other)
    on_cpu = known and one["device"].get("platform") == other["device"].get("platform") == "cpu"
    return on_cpu and differing(one, other) <= {but}


NOT_OURS: Final = ":(exclude,glob)**/site-packages/**"
"""What virtual environments hold, which may lie in a project without being ignored."""


def git_state() -> dict[str, Any] | None:
    """Return {"sha", "dirty"} of the repository around the current folder, or None when git cannot tell.

    "sha" is None before the first commit. "dirty" means that a tracked file differs from that commit, or that below
    the current folder there is code, or a robot, that is neither tracked nor ignored: a clone would lack it.
    """
    if _git("rev-parse", "--is-inside-work-tree") != "true":
        return None
    status = _git("status", "--porcelain", "--untracked-files=no")
    if status is None:
        return None
    status = status or _git("ls-files", "--others", "--exclude-standard", "--", "*.py", "*.xml", NOT_OURS)
    sha = _git("rev-parse", "--verify", "--quiet", "HEAD")
    known = sha is not None and re.fullmatch(r"[0-9a-f]{40,64}", sha) is not None
    return {"sha": sha if known else None, "dirty": bool(status)}


def _git(*arguments: str) -> str | None:
    """Return what a read-only git command prints, or None when git is missing, slow or fails."""
    try:
        done = subprocess.run(
            ["git", "-c", "core.fsmonitor=false", *arguments],
            capture_output=True,
            stdin=subprocess.DEVNULL,
            timeout=GIT_SECONDS,
            check=True,
            env={**os.environ, "GIT_OPTIONAL_LOCKS": "0"},  # never take the index lock from a user's own git
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.decode(errors="replace").strip()


def versions() -> dict[str, str | None]:
    """Return the installed version of every package that can change a result (None where absent), and Python's."""
    return {"python": platform.python_version(), **{name: version_of(name) for name in PACKAGES}}


def cuda_versions() -> dict[str, str]:
    """Return the versions of installed packages that contain CUDA, cuDNN and so on, by name."""
    found = [(_name_of(one), one) for one in importlib.metadata.distributions()]
    return dict(sorted((name, one.version) for name, one in found if CUDA.fullmatch(name)))


def _name_of(distribution: importlib.metadata.Distribution) -> str:
    """Return a package's name; parsing the whole metadata of all packages would take a third of a second."""
    metadata = distribution.read_text("METADATA") or distribution.read_text("PKG-INFO") or ""
    found = re.search(r"^Name:\s*(\S+)", metadata, re.MULTILINE | re.IGNORECASE)
    return found[1].lower().replace("_", "-") if found else ""


@functools.cache
def version_of(package: str) -> str | None:
    """Return a package's version, or None; cached because imported packages do not change while a process runs."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def device_of(devices: Sequence[Any]) -> dict[str, Any]:
    """Return platform, kind and count of JAX's devices, which are all alike."""
    return {"platform": devices[0].platform, "kind": devices[0].device_kind, "count": len(devices)}


def machine_class() -> str:
    """Return operating system, architecture and processor; equal machines should give equal bits."""
    return " ".join(f"{platform.system()} {platform.machine()} {_processor()}".split())


def instructions() -> str | None:
    """Return the processor that programs are compiled for and its widest vectors, such as "znver3 avx2".

    The operating system's name of it may leave this open, as "AMD EPYC" does on virtual machines, which are of several
    kinds and give other bits. None where llvmlite, which knows what XLA's compiler does, is not installed.
    """
    try:
        from llvmlite import binding
    except (ImportError, OSError):
        return None
    features = binding.get_host_cpu_features()
    widest = next((name for name in VECTORS if features.get(name)), "")
    return f"{binding.get_host_cpu_name()} {widest}".strip()


def _processor() -> str:
    """Return the processor's model name as the operating system reports it (empty if unknown)."""
    try:
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass  # not Linux
    return platform.processor()
