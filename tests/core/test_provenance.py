"""Provenance is complete, plain JSON, and never stops a run."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jax
import numpy
import pytest

from evoclaims.core import provenance


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty git repository that is the current folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    subprocess.run(["git", "init", "--quiet"], check=True)
    return tmp_path


def test_provenance_is_plain_json_with_every_part_looked_up_once(monkeypatch: pytest.MonkeyPatch) -> None:
    found = provenance.collect()
    assert json.loads(json.dumps(found)) == found
    device = jax.devices()[0]
    assert found["device"] == {"platform": device.platform, "kind": device.device_kind, "count": len(jax.devices())}
    assert set(found) == {
        "git",
        "versions",
        "device",
        "machine",
        "instructions",
        "xla_flags",
        "matmul_precision",
        "x64",
        "cuda",
        "prng",
    }
    found["versions"]["numpy"] = "changed"  # in this copy alone
    monkeypatch.setattr(provenance, "git_state", lambda: pytest.fail("looked up again"))
    assert provenance.collect()["versions"]["numpy"] == numpy.__version__


def test_versions_name_every_package_and_say_null_for_an_absent_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "PACKAGES", ("numpy", "evoclaims-no-such-package"))
    versions = provenance.versions()
    assert versions["numpy"] == numpy.__version__
    assert versions["evoclaims-no-such-package"] is None
    assert versions["python"] is not None


def test_the_versions_of_whatever_brings_cuda_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = {
        "jax-cuda13-plugin": "0.11.2",
        "jax_cuda12_pjrt": "0.10.2",
        "nvidia-cudnn-cu13": "9.1",
        "nvidia-cublas": "13.0",
        "jaxtyping": "0.3",
        "my-nvidia-tool": "1",
    }
    for name, version in installed.items():
        folder = tmp_path / f"{name.replace('-', '_')}-{version}.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    monkeypatch.setattr("sys.path", [str(tmp_path)])
    assert provenance.cuda_versions() == {
        "jax-cuda12-pjrt": "0.10.2",
        "jax-cuda13-plugin": "0.11.2",
        "nvidia-cublas": "13.0",
        "nvidia-cudnn-cu13": "9.1",
    }


def test_the_generator_of_random_bits_is_named() -> None:
    script = "from evoclaims.core import provenance; print(provenance.collect()['prng'])"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "JAX_DEFAULT_PRNG_IMPL": "rbg"}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "{'implementation': 'rbg', 'partitionable': True}"
    assert provenance.collect()["prng"]["implementation"] == "threefry2x32"


@pytest.mark.parametrize(
    "part", ["machine", "instructions", "versions", "xla_flags", "matmul_precision", "x64", "prng"]
)
def test_bits_hang_on_every_part_that_can_change_them(part: str) -> None:
    known = provenance.collect()
    assert provenance.what_fixes_bits({**known, part: "another"}) != provenance.what_fixes_bits(known)


def test_bits_hang_on_the_kind_of_device_and_on_cuda_where_a_gpu_is_used() -> None:
    cpu = {
        "device": {"platform": "cpu", "kind": "cpu", "count": 2},
        "git": {"sha": "a"},
        "cuda": {"nvidia-cublas": "1"},
    }
    gpu = {**cpu, "device": {"platform": "gpu", "kind": "H200", "count": 1}}
    changed = {"git": {"sha": "b"}, "cuda": {"nvidia-cublas": "2"}}
    assert provenance.what_fixes_bits({**cpu, **changed}) == provenance.what_fixes_bits(cpu) == {"kind": "cpu"}
    assert provenance.what_fixes_bits({**gpu, **changed}) != provenance.what_fixes_bits(gpu)
    assert provenance.what_fixes_bits({**gpu, "instructions": "znver4 avx512f"}) == provenance.what_fixes_bits(gpu)
    assert provenance.what_fixes_bits(gpu)["kind"] == "H200"


def test_the_machine_class_is_one_line_that_starts_with_the_system() -> None:
    machine = provenance.machine_class()
    assert machine.split()[0] in {"Linux", "Darwin", "Windows"}
    assert machine == " ".join(machine.split())


def test_a_repository_gives_its_commit_and_is_dirty_when_a_tracked_file_was_edited(repository: Path) -> None:
    def git(*arguments: str) -> str:
        who = ["-c", "user.name=someone", "-c", "user.email=someone@example.org"]
        return subprocess.run(["git", *who, *arguments], capture_output=True, text=True, check=True).stdout.strip()

    assert provenance.git_state() == {"sha": None, "dirty": False}
    (repository / "code.py").write_text("x = 1\n")
    git("add", "code.py")
    git("commit", "--quiet", "-m", "a change")
    (repository / "notes.txt").write_text("results\n")  # which is not tracked
    assert provenance.git_state() == {"sha": git("rev-parse", "HEAD"), "dirty": False}
    packages = repository / "env" / "lib" / "site-packages"
    packages.mkdir(parents=True)
    (packages / "installed.py").write_text("x = 1\n")
    assert provenance.git_state() == {"sha": git("rev-parse", "HEAD"), "dirty": False}
    (repository / "folder").mkdir()
    (repository / "folder" / "forgotten.py").write_text("x = 1\n")
    assert provenance.git_state() == {"sha": git("rev-parse", "HEAD"), "dirty": True}
    (repository / ".gitignore").write_text("folder\n")
    assert provenance.git_state() == {"sha": git("rev-parse", "HEAD"), "dirty": False}
    (repository / "code.py").write_text("x = 2\n")
    assert provenance.git_state() == {"sha": git("rev-parse", "HEAD"), "dirty": True}


def test_without_a_repository_or_git_there_is_no_git_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert provenance.git_state() is None
    monkeypatch.setenv("PATH", str(tmp_path))
    assert provenance.git_state() is None


def test_a_git_that_hangs_has_no_git_state(monkeypatch: pytest.MonkeyPatch) -> None:
    def hang(*arguments: Any, **options: Any) -> None:
        assert options["timeout"] == provenance.GIT_SECONDS
        raise subprocess.TimeoutExpired("git", provenance.GIT_SECONDS)

    monkeypatch.setattr(subprocess, "run", hang)
    assert provenance.git_state() is None


def test_a_git_that_prints_nonsense_gives_no_sha(monkeypatch: pytest.MonkeyPatch) -> None:
    def nonsense(arguments: list[str], **options: Any) -> subprocess.CompletedProcess[bytes]:
        text = b"true" if "--is-inside-work-tree" in arguments else b"\xff warning: strange"
        return subprocess.CompletedProcess(arguments, 0, stdout=text)

    monkeypatch.setattr(subprocess, "run", nonsense)
    assert provenance.git_state() == {"sha": None, "dirty": True}


def test_processors_of_one_name_are_told_apart_by_their_widest_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    from llvmlite import binding

    monkeypatch.setattr(binding, "get_host_cpu_name", lambda: "znver4")
    told = []
    for features in ({"avx": True, "avx2": True, "avx512f": True}, {"avx": True, "avx2": True, "avx512f": False}, {}):
        monkeypatch.setattr(binding, "get_host_cpu_features", lambda features=features: features)
        told.append(provenance.instructions())
    assert told == ["znver4 avx512f", "znver4 avx2", "znver4"]


@pytest.mark.parametrize(
    ("flags", "kept"),
    [
        (None, None),
        ("", None),
        ("--xla_dump_to=/tmp/x --xla_force_host_platform_device_count=8", None),
        ("--xla_b=1 --xla_a=2", "--xla_a=2 --xla_b=1"),
        ("--xla_a=1 --xla_a=2  --xla_dump_to=x", "--xla_a=2"),
    ],
)
def test_flags_that_change_a_trial_are_told_from_those_that_do_not(flags: str | None, kept: str | None) -> None:
    assert provenance.flags_that_change(flags) == kept
