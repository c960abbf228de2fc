"""Which GPUs there are, and which of them each of several processes sees; no GPU is needed for it."""

from __future__ import annotations

import importlib.metadata
import os
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.execution import host as gpus


@pytest.fixture
def host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A host with three GPUs and jax for CUDA: the folder of its device files."""
    for name in ("nvidia0", "nvidia1", "nvidia7", "nvidiactl", "nvidia-uvm", "null"):
        (tmp_path / name).touch()
    monkeypatch.setattr(gpus, "_NODES", tmp_path)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [SimpleNamespace(name="xla_cuda12")])
    for name in ("JAX_PLATFORMS", gpus.VISIBLE, gpus.MEMORY):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


@pytest.mark.usefixtures("host")
def test_gpus_are_those_that_the_process_may_open_or_that_its_environment_names(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert gpus.gpus("auto") == gpus.gpus("gpu") == ("0", "1", "2")
    assert gpus.gpus("cpu") == ()
    for named, found in (("2, GPU-4711", ("2", "GPU-4711")), ("", ()), ("-1", ())):
        monkeypatch.setenv(gpus.VISIBLE, named)
        assert gpus.gpus("auto") == found


@pytest.mark.usefixtures("host")
@pytest.mark.parametrize(("asked", "number"), [("cpu", 0), ("cuda,cpu", 3), ("gpu", 3), ("", 3)])
def test_the_platforms_that_a_user_has_chosen_stay(asked: str, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("JAX_PLATFORMS", asked)
    assert len(gpus.gpus("auto")) == number


@pytest.mark.usefixtures("host")
def test_a_jax_without_cuda_has_no_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [])
    assert gpus.gpus("auto") == ()


@given(st.integers(1, 9), st.integers(1, 20))
def test_processes_have_gpus_of_their_own_or_share_one_and_its_memory(count: int, processes: int) -> None:
    found = [f"GPU-{number}" for number in range(count)]
    environments = gpus.sharing_gpus(found, processes)
    seen = [(one[gpus.VISIBLE].split(","), float(one.get(gpus.MEMORY, 0.75))) for one in environments]
    assert len(seen) == processes
    used = Counter(gpu for names, _ in seen for gpu in names)
    assert used.keys() == set(found[: max(processes, count)])
    assert max(used.values()) - min(used.values()) <= 1
    for gpu, crowd in used.items():
        taken = sum(memory for names, memory in seen if gpu in names)
        assert taken <= 0.91
        assert crowd == 1 or all(names == [gpu] for names, _ in seen if gpu in names)


@pytest.mark.usefixtures("host")
def test_a_share_of_memory_that_a_user_has_set_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gpus.MEMORY, "0.2")
    assert gpus.sharing_gpus(["0"], 2) == [{gpus.VISIBLE: "0"}] * 2


def test_mps_runs_where_its_process_lives_for_this_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUDA_MPS_PIPE_DIRECTORY", str(tmp_path))
    monkeypatch.setattr(gpus, "_PROCESSES", tmp_path)
    number, process = tmp_path / "nvidia-cuda-mps-control.pid", tmp_path / "4711"
    process.mkdir()
    (process / "cmdline").write_bytes(b"nvidia-cuda-mps-control\0-d\0")
    assert not gpus.mps_runs()
    number.write_text("4711")
    assert gpus.mps_runs()
    for text in ("4712", "", "no number", "9" * 5000, "-1"):
        number.write_text(text)
        assert not gpus.mps_runs()
    number.write_text("4711\n")
    monkeypatch.setattr(os, "getuid", lambda: 1 + os.stat(process).st_uid)
    assert gpus.mps_runs() == (os.stat(process).st_uid == 0)  # root's serves everybody
    monkeypatch.undo()
    monkeypatch.setenv("CUDA_MPS_PIPE_DIRECTORY", str(tmp_path))
    number.write_text(str(os.getpid()))  # another process has the number now
    assert not gpus.mps_runs()
    number.unlink()
    os.mkfifo(number)  # which nobody writes into
    assert not gpus.mps_runs()
