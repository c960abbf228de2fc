"""Choosing the hardware: one sentence where it is not there, and no hand in what a user has decided."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from trial_toys import walk

from evoclaims.core import files
from evoclaims.core.errors import UserError
from evoclaims.trials import devices
from evoclaims.trials.layout import Layout, layout_on
from evoclaims.trials.runner import run
from evoclaims.trials.store import Store


def test_an_unknown_device_is_a_sentence_with_the_known_ones() -> None:
    with pytest.raises(UserError, match="There is no device named 'gpus'.*Known: auto, cpu, gpu"):
        devices.choose("gpus")


def test_a_gpu_that_is_not_there_is_a_sentence_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(platform: str | None = None) -> list[object]:
        raise RuntimeError("Unknown backend")

    monkeypatch.setattr("jax.devices", none)
    monkeypatch.setenv("JAX_PLATFORMS", "cuda")
    with pytest.raises(UserError, match=r"'gpu' with JAX_PLATFORMS=cuda\. Install jax for CUDA .*\"cpu\"") as caught:
        devices.choose("gpu")
    assert "\n" not in str(caught.value)


def test_the_cpu_can_always_be_asked_for() -> None:
    assert {device.platform for device in devices.choose("cpu")} == {"cpu"}
    assert layout_on(devices.choose("cpu")[0].platform) is Layout.ALONE


def test_heaps_are_shared_before_jax_makes_threads_and_memory_is_given_back_after_a_batch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []
    libc = SimpleNamespace(mallopt=lambda *which: calls.append(which), malloc_trim=lambda _: calls.append("trim"))
    monkeypatch.setattr(devices, "_libc", lambda: libc)
    devices.configure()
    assert calls == [(-8, 2)]
    run(walk(steps=2), [0], Store(tmp_path), devices.choose("cpu"))
    assert calls[-1] == "trim"


SCRIPT = """
import json, jax
from evoclaims.trials import devices
devices.configure()
devices.configure()
print(json.dumps([len(jax.devices()), jax.config.jax_compilation_cache_dir]))
"""


def _configured(**settings: str) -> tuple[int, str]:
    """Return what a fresh process sees under these environment variables."""
    ours = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "XLA_"))}
    environment = {**ours, "JAX_PLATFORMS": "cpu", "PYTHONPATH": os.pathsep.join(sys.path), **settings}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    count, folder = json.loads(done.stdout)
    return count, folder


def test_a_cpu_is_one_device_and_there_is_a_cache_that_lasts(tmp_path: Path) -> None:
    assert _configured(XDG_CACHE_HOME=str(tmp_path)) == (1, str(tmp_path / "evoclaims" / "xla"))


def test_what_a_user_has_decided_stays(tmp_path: Path) -> None:
    assert _configured(JAX_NUM_CPU_DEVICES="3", JAX_COMPILATION_CACHE_DIR=str(tmp_path)) == (3, str(tmp_path))


def test_a_relative_cache_folder_is_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "relcache")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert devices._cache() == tmp_path / ".cache" / "evoclaims" / "xla"


@pytest.mark.parametrize("writable", ["", "evoclaims/xla", "evoclaims", "."])
def test_a_cache_that_others_can_write_is_not_used(
    writable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    files.say_refused.cache_clear()
    folder = tmp_path / "evoclaims" / "xla"
    previous = os.umask(0)
    try:
        assert devices._cache() == folder
    finally:
        os.umask(previous)
    assert folder.stat().st_mode & 0o777 == folder.parent.stat().st_mode & 0o777 == 0o700
    (tmp_path / writable).chmod(0o777 if writable else 0o1777)  # the sticky bit keeps others from exchanging folders
    if not writable:
        assert devices._cache() == folder
        return
    with pytest.warns(UserWarning, match="^Not using compiled programs in"):
        assert devices._cache() is None
