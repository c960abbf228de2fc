"""Damaged entries of the cache of compiled programs go when a process starts, and nothing else that lies there."""

from __future__ import annotations

import os
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import pytest
from trial_toys import walk

from evoclaims.trials import devices
from evoclaims.trials.devices import sweep
from evoclaims.trials.runner import run
from evoclaims.trials.store import Store


@pytest.fixture(scope="module", autouse=True)
def compiled_once() -> None:
    """Nothing is kept here from other tests: what is compiled again is looked at."""


@pytest.fixture
def compilation_cache(tmp_path: Path) -> Iterator[Path]:
    """A compilation cache of the test's own."""
    from jax.experimental.compilation_cache import compilation_cache

    options = {"jax_compilation_cache_dir": str(tmp_path / "xla"), "jax_persistent_cache_min_compile_time_secs": 0.0}
    was = {name: getattr(jax.config, name) for name in options}
    for name, value in options.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()
    yield tmp_path / "xla"
    for name, value in was.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()


def tear(cache: Path) -> int:
    """Cut every entry, as a kill can, since jax writes them in place; so does one process see what another writes."""
    entries = list(cache.glob("*-cache"))
    for entry in entries:
        entry.write_bytes(entry.read_bytes()[:100])
    jax.clear_caches()
    return len(entries)


def name(number: int) -> str:
    """Return the name of an entry, as jax gives them."""
    return f"jit_step-{number:064x}-cache"


def test_what_a_full_disk_has_torn_is_compiled_and_kept_again(compilation_cache: Path) -> None:
    assert jax.jit(lambda x: x + 43)(1) == 44
    whole = {path.name: path.stat().st_size for path in compilation_cache.iterdir() if "-cache" in path.name}
    sweep(compilation_cache)
    assert tear(compilation_cache) == len(whole) >= 1  # these are names that jax gives: else nothing would be swept
    sweep(compilation_cache)
    assert not [*compilation_cache.glob("*-cache")]
    assert jax.jit(lambda x: x + 43)(1) == 44
    assert {path.name for path in compilation_cache.glob("*-cache")} <= whole.keys()
    assert [*compilation_cache.glob("*-cache")]


def test_damaged_entries_go_and_others_stay(tmp_path: Path) -> None:
    sound, data = tmp_path / name(0), zlib.compress(os.urandom(1000))
    sound.write_bytes(data)
    for number, torn in enumerate((b"", data[:-1], data[:500] + b"?" + data[501:], b"\x28\xb5\x2f\xfd"), start=1):
        (tmp_path / name(number)).write_bytes(torn)
    os.mkfifo(tmp_path / name(8))
    (tmp_path / name(9)).mkdir()
    (tmp_path / name(10)).symlink_to("/dev/zero")
    (tmp_path / name(11)).mkdir()
    (tmp_path / name(11) / "file").touch()
    (tmp_path / "pip-cache").touch()  # of somebody else, in a folder that a user has named
    sweep(tmp_path)
    left = {path.name for path in tmp_path.iterdir()} - {devices._SWEPT}
    # Without the package nobody can say whether an entry of zstandard is whole.
    assert left - {name(4)} == {name(0), name(11), "pip-cache"}
    assert sound.read_bytes() == data


def test_only_what_is_new_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    monkeypatch.setattr(devices, "_is_whole", lambda entry: bool(read.append(entry.name)) or True)
    for number in (0, 1):
        (tmp_path / name(number)).write_bytes(b"data")
        os.utime(tmp_path / name(number), (1.0, 1.0))
    sweep(tmp_path)
    (tmp_path / name(2)).write_bytes(b"data")
    sweep(tmp_path)
    assert sorted(read) == [name(0), name(1), name(2)]


def test_beyond_a_bound_what_was_used_longest_ago_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "MOST_BYTES", 250)
    (tmp_path / "kernels").mkdir()
    made = [*(tmp_path / "kernels" / f"{age}.o" for age in range(4)), *(tmp_path / name(age) for age in range(4))]
    for age, path in enumerate(made):
        path.write_bytes(zlib.compress(os.urandom(89), 0))
        assert path.stat().st_size == 100
        os.utime(path, (age + 1.0, age + 1.0))
    (tmp_path / "kernels" / "0.lock").touch()
    os.utime(tmp_path / "kernels" / "0.lock", (1.0, 1.0))
    sweep(tmp_path, most=None)
    assert [path.exists() for path in made] == [False, False, True, True] + [True] * 4
    assert not (tmp_path / "kernels" / "0.lock").exists()
    sweep(tmp_path, most=150)
    assert [path.exists() for path in made[4:]] == [False, False, False, True]


def test_a_torn_entry_of_the_compilation_cache_costs_time_and_nothing_else(
    tmp_path: Path, cpus: list[Any], compilation_cache: Path
) -> None:
    condition = walk(steps=7)
    wanted = run(condition, [0], Store(tmp_path / "one"), cpus)
    assert tear(compilation_cache) >= 3
    with warnings.catch_warnings(action="error"):
        assert run(condition, [0], Store(tmp_path / "two"), cpus)[0].digest == wanted[0].digest
