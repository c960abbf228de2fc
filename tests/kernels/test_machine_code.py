"""Machine code is compiled once a machine, kept on disk, and made again when its file is damaged or another user's."""

from __future__ import annotations

import ctypes
import hashlib
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filelock import FileLock

from evoclaims.core import files
from evoclaims.kernels.call.kernel import one_kernel
from evoclaims.kernels.emit import machine_code

TEXT = "define i32 @seven(i32 %x) {\n%y = mul i32 %x, 7\nret i32 %y\n}\n"
NEW_LINKER = machine_code._linker.__wrapped__
PROCESS = """
import sys, time, jax
from evoclaims.kernels.emit import machine_code

def slowly(text, compiled=machine_code.compiled):
    print("compiles", flush=True)
    time.sleep(1)
    return compiled(text)

machine_code.compiled = slowly
jax.config.update("jax_compilation_cache_dir", sys.argv[1])
assert machine_code.address(sys.argv[2], "seven")
"""


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Start with nothing in memory and an empty cache on disk; return the texts that are compiled."""
    texts: list[str] = []

    def noted(text: str, compiled: Any = machine_code.compiled) -> bytes:
        texts.append(text)
        return bytes(compiled(text))

    before = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    monkeypatch.setattr(machine_code, "compiled", noted)
    _forget(monkeypatch)
    yield texts
    jax.config.update("jax_compilation_cache_dir", before)


def _forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget the machine code in memory, as another process would."""
    machine_code.lanes()
    monkeypatch.setattr(machine_code, "_libraries", {})
    monkeypatch.setattr(machine_code, "_linker", cache(NEW_LINKER))


def _seven_times(number: int) -> int:
    """Call the machine code of `TEXT`."""
    return int(ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int)(machine_code.address(TEXT, "seven"))(number))


def test_a_text_is_compiled_once_and_read_from_disk_afterwards(
    compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert [_seven_times(2), _seven_times(3)] == [14, 21]
    _forget(monkeypatch)
    assert _seven_times(4) == 28
    assert compiled == [TEXT]
    assert (tmp_path / "kernels" / f"{machine_code.key_of(TEXT)}.o").is_file()


@pytest.mark.parametrize("damage", [b"", b"torn", None])
def test_a_damaged_file_is_made_again(
    damage: bytes | None, compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _seven_times(1)
    path = tmp_path / "kernels" / f"{machine_code.key_of(TEXT)}.o"
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + b"?" if damage is None else damage)
    _forget(monkeypatch)
    assert _seven_times(5) == 35
    assert compiled == [TEXT, TEXT]
    assert path.read_bytes() == whole


def _plant(path: Path) -> bytes:
    """Put machine code with a sound checksum and another result into the cache, as another user could."""
    code = machine_code.compiled(TEXT.replace("7", "8"))
    path.write_bytes(hashlib.sha256(code).digest() + code)
    return path.read_bytes()


@pytest.mark.parametrize("fault", ["", "owner", "writable file", "writable folder", "folder's owner", "writable above"])
def test_machine_code_another_user_could_have_written_is_not_run(
    fault: str, compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _seven_times(1)
    folder = tmp_path / "kernels"
    path = folder / f"{machine_code.key_of(TEXT)}.o"
    assert (path.stat().st_mode & 0o777, folder.stat().st_mode & 0o777) == (0o600, 0o700)
    planted = _plant(path)
    del compiled[:]
    for place in {"owner": [path], "folder's owner": [folder]}.get(fault, []):
        if os.getuid():  # only root can give a file away: be somebody else instead
            monkeypatch.setattr(os, "getuid", lambda: 12345)
        else:
            os.chown(place, 65534, 65534)
    for place in {"writable file": [path], "writable folder": [folder], "writable above": [tmp_path]}.get(fault, []):
        place.chmod(0o777)
    _forget(monkeypatch)
    files.say_refused.cache_clear()
    if not fault:  # the planted code does run where nobody else could have written it
        assert (_seven_times(2), compiled) == (16, [])
        return
    with pytest.warns(UserWarning, match=r"^Not using compiled programs in .* \((uid|mode) .* They are compiled again"):
        assert _seven_times(2) == 14
    assert compiled == [TEXT]
    healed = fault in ("owner", "writable file") and path.read_bytes() != planted
    assert healed or path.read_bytes() == planted


def test_refused_code_is_reported_once_and_never_an_error(
    compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    (tmp_path / "kernels").mkdir(mode=0o700)
    (tmp_path / "kernels").chmod(0o777)
    files.say_refused.cache_clear()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert _seven_times(2) == 14  # as in a pytest run in which warnings are errors
    files.say_refused.cache_clear()
    for _ in range(3):
        _forget(monkeypatch)
        assert _seven_times(2) == 14
    assert [str(one.message)[:30] for one in recwarn] == ["Not using compiled programs in"]


def test_a_lock_that_is_never_released_ends_in_compiling_alone(
    compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[str] = []
    monkeypatch.setattr(machine_code, "PATIENCE", 0.05)
    monkeypatch.setattr(machine_code, "waiting", lambda: nullcontext(waits.append("for a lock")))
    (tmp_path / "kernels").mkdir(mode=0o700)
    with FileLock(tmp_path / "kernels" / f"{machine_code.key_of(TEXT)}.lock"):  # as one stopped by Ctrl-Z holds it
        assert _seven_times(6) == 42
    assert (compiled, waits) == ([TEXT], ["for a lock"])  # which is nobody's time


def test_another_text_or_another_processor_has_another_key(monkeypatch: pytest.MonkeyPatch) -> None:
    machine_code.lanes()
    key = machine_code.key_of(TEXT)
    assert machine_code.key_of(TEXT + "\n") != key
    monkeypatch.setattr(machine_code.llvm, "get_host_cpu_name", lambda: "another")
    assert machine_code.key_of(TEXT) != key


def test_where_nothing_can_be_kept_it_is_compiled_all_the_same(compiled: list[str], tmp_path: Path) -> None:
    (tmp_path / "kernels").write_text("a file where the folder should be")
    assert _seven_times(6) == 42
    assert compiled == [TEXT]


def test_two_processes_compile_a_text_once(tmp_path: Path) -> None:
    command = [sys.executable, "-c", PROCESS, str(tmp_path), TEXT]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ) for _ in range(2)]
    said = [process.communicate()[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert "".join(said).count("compiles") == 1


def test_without_llvm_a_function_runs_as_it_is_and_a_warning_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_code, "llvm", None)
    machine_code.lanes.cache_clear()
    x = jnp.arange(3.0)
    with pytest.warns(UserWarning, match="^A sum is not one kernel, and slower, because of .*llvmlite.* not installed"):
        made = jax.vmap(one_kernel(lambda x: x + 1, "A sum"))(x)
    np.testing.assert_array_equal(made, x + 1)
    machine_code.lanes.cache_clear()
